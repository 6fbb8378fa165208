// Packets among instances answer as single rays do: coherent and not, with triangles beside, in scenes of all kinds, where several things lie at one distance and where rays begin on
// them, with masks, and with lanes that ask for nothing or are no rays.
#include "check.h"

namespace {

unsigned state = 5;
unsigned below(unsigned n) { return state = state * 1664525 + 1013904223, (state >> 16) % n; }
float uniform(float a, float b) { return a + (b - a) * (below(65536) / 65536.f); }
// Of whole numbers often, so that distances are the same.
Vec place(float size) {
  if (below(3)) return {float(int(below(2 * unsigned(size) + 1)) - int(size)), float(int(below(2 * unsigned(size) + 1)) - int(size)), float(below(3))};
  return {uniform(-size, size), uniform(-size, size), uniform(0, 3)};
}

// Floors at whole heights, of which several are at one, by themselves and in instances: what is hit where rays end or begin, too.
void stack(World& w, int flags) {
  RTCScene scene = rtcNewScene(w.device);
  rtcSetSceneFlags(scene, RTCSceneFlags(flags));
  w.add(w.floor(0), scene);
  rtcCommitScene(scene);
  for (unsigned i = 0; i < 2 + below(6); i++) {
    const float z = float(below(4));
    if (below(2)) {
      w.add(w.floor(z));
      continue;
    }
    RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(g, scene);
    const float m[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, z};
    rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
    rtcSetGeometryMask(g, ~0u);
    w.add(g);
  }
  rtcReleaseScene(scene);
  rtcCommitScene(w.scene);
}

RTCScene inner(World& w, int flags) {
  RTCScene scene = rtcNewScene(w.device);
  rtcSetSceneFlags(scene, RTCSceneFlags(flags));
  const unsigned kind = below(6);
  for (unsigned g = 0; g <= below(2); g++) {
    std::vector<Vec> points;
    std::vector<unsigned> indices;
    for (unsigned i = 0; i < 1 + below(30); i++) {
      const Vec c = place(1);
      const Vec corners[3] = {c, c + Vec{1, 0, float(below(2))}, c + Vec{0, 1, 0}};
      for (unsigned k = 0; k < 3; k++) points.push_back(corners[k]), indices.push_back(3 * i + k);
    }
    w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {points}, indices), scene);
  }
  if (kind == 1) w.add(w.mesh(RTC_GEOMETRY_TYPE_QUAD, {{{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}}, {0, 1, 2, 3}), scene);
  if (kind == 2) {
    RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    const float ball[4] = {0, 0, 1, 0.5f};
    std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, 1), ball, 16);
    rtcSetGeometryMask(g, ~0u);
    w.add(g, scene);
  }
  if (kind == 3) {
    RTCGeometry g = w.floor(1);
    rtcSetGeometryMask(g, 2);
    w.add(g, scene);
  }
  if (kind == 4) {
    RTCGeometry g = w.floor(2);
    rtcSetGeometryIntersectFilterFunction(g, [](const RTCFilterFunctionNArguments* a) { a->valid[0] = 0; });
    w.add(g, scene);
  }
  rtcCommitScene(scene);
  return scene;
}

template <int N> struct Packet;
template <> struct Packet<4> { using Hit = RTCRayHit4; using Ray = RTCRay4; };
template <> struct Packet<8> { using Hit = RTCRayHit8; using Ray = RTCRay8; };
template <> struct Packet<16> { using Hit = RTCRayHit16; using Ray = RTCRay16; };
#ifdef EMBREE4
#define TRACE(N)                                                                                              \
  void trace(const int* v, RTCScene s, Query& q, RTCRayHit##N* r) { rtcIntersect##N(v, s, r, &q.intersect); } \
  void trace(const int* v, RTCScene s, Query& q, RTCRay##N* r) { rtcOccluded##N(v, s, r, &q.occluded); }
#else
#define TRACE(N)                                                                                            \
  void trace(const int* v, RTCScene s, Query& q, RTCRayHit##N* r) { rtcIntersect##N(v, s, &q.context, r); } \
  void trace(const int* v, RTCScene s, Query& q, RTCRay##N* r) { rtcOccluded##N(v, s, &q.context, r); }
#endif
TRACE(4) TRACE(8) TRACE(16)

int differ, all;

template <int N> void packet(RTCScene scene, bool coherent, bool stacked = false) {
  alignas(64) int valid[N];
  RTCRayHit single[N];
  alignas(64) typename Packet<N>::Hit packet;
  std::memset(&packet, 0, sizeof packet);
  const Vec eye = {uniform(-3, 3), uniform(-3, 3), -8}, middle = {uniform(-3, 3), uniform(-3, 3), 2};
  const bool parallel = below(2);
  for (int i = 0; i < N; i++) {
    valid[i] = below(8) ? -1 : 0;
    Vec o = eye, d = middle - eye + Vec{uniform(-.1f, .1f), uniform(-.1f, .1f), 0};
    if (parallel) o = Vec{float(int(eye.x)) + .25f + .001f * i, float(int(eye.y)) + .25f, -8}, d = {0, 0, 1};
    if (stacked) o = {.25f + .001f * i, .25f, -8}, d = {0, 0, 1};
    if (!coherent) o = Vec{uniform(-5, 5), uniform(-5, 5), uniform(-5, 5)}, d = Vec{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    // Embree wants none of these.
    if (is_ours() && below(50) == 0) d = {0, 0, 0};
    if (is_ours() && below(50) == 0) o.x = NAN;
    RTCRayHit& r = single[i] = make_ray(o, d, below(4) ? INFINITY : float(7 + below(5)), 0, below(4) ? ~0u : below(4));
    // Where something may lie, to the bit.
    if (below(4) == 0) r.ray.tnear = float(8 + below(3));
    const RTCRay& s = r.ray;
    packet.ray.org_x[i] = s.org_x, packet.ray.org_y[i] = s.org_y, packet.ray.org_z[i] = s.org_z, packet.ray.tnear[i] = s.tnear;
    packet.ray.dir_x[i] = s.dir_x, packet.ray.dir_y[i] = s.dir_y, packet.ray.dir_z[i] = s.dir_z;
    packet.ray.tfar[i] = s.tfar, packet.ray.mask[i] = s.mask;
    packet.hit.geomID[i] = packet.hit.primID[i] = packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
#ifdef EMBREE4
    packet.hit.instPrimID[0][i] = single[i].hit.instPrimID[0] = RTC_INVALID_GEOMETRY_ID;
#endif
  }
  typename Packet<N>::Ray rays = packet.ray;
  Query query;
  trace(valid, scene, query, &packet);
  trace(valid, scene, query, &rays);
  for (int i = 0; i < N; i++) {
    const float tfar = single[i].ray.tfar;
    if (!valid[i]) {
      if (is_ours()) CHECK(packet.ray.tfar[i] == tfar && rays.tfar[i] == tfar && packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID);
      continue;
    }
    RTCRayHit any = single[i];
    intersect(scene, single[i]);
    const RTCRayHit& r = single[i];
    bool same = packet.hit.geomID[i] == r.hit.geomID && packet.hit.instID[0][i] == r.hit.instID[0] && packet.ray.tfar[i] == r.ray.tfar;
    if (same && is_hit(r))
      same = packet.hit.primID[i] == r.hit.primID && packet.hit.u[i] == r.hit.u && packet.hit.v[i] == r.hit.v && packet.hit.Ng_x[i] == r.hit.Ng_x &&
             packet.hit.Ng_y[i] == r.hit.Ng_y && packet.hit.Ng_z[i] == r.hit.Ng_z;
#ifdef EMBREE4
    same = same && packet.hit.instPrimID[0][i] == r.hit.instPrimID[0];
#endif
    differ += !same, all++;
    // Filters ask of closest hits alone, so that there may be more of these.
    differ += (rays.tfar[i] < 0) != occluded(scene, any.ray), all++;
    if (is_ours()) CHECK(same && (rays.tfar[i] < 0) == (any.ray.tfar < 0));
  }
}

}  // namespace

// Callbacks within an instance that ask again, and count how often they are called: as often as by single rays.
static int calls;
static void ask_again() {
  World w;
  RTCScene inner = rtcNewScene(w.device), deep = rtcNewScene(w.device);
  w.add(w.floor(3), deep);
  rtcCommitScene(deep);
  RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(g, 1);
  rtcSetGeometryUserData(g, deep);
  rtcSetGeometryBoundsFunction(g, [](const RTCBoundsFunctionArguments* a) { *a->bounds_o = {0, 0, 1, 0, 1, 1, 2, 0}; }, nullptr);
  rtcSetGeometryIntersectFunction(g, [](const RTCIntersectFunctionNArguments* a) {
    calls++;
    RTCScene deep = (RTCScene)a->geometryUserPtr;
    alignas(64) RTCRayHit8 p;
    alignas(64) int valid[8];
    std::memset(&p, 0, sizeof p);
    for (int i = 0; i < 8; i++) {
      valid[i] = -1;
      p.ray.org_x[i] = p.ray.org_y[i] = .25f, p.ray.dir_z[i] = 1, p.ray.tfar[i] = INFINITY, p.ray.mask[i] = ~0u;
      p.hit.geomID[i] = p.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    Query query;
    trace(valid, deep, query, &p);
    for (int i = 0; i < 8; i++) CHECK(p.hit.geomID[i] == 0 && p.ray.tfar[i] == 3);
  });
  rtcSetGeometryMask(g, ~0u);
  w.add(g, inner);
  rtcCommitScene(inner);
  w.add(w.floor(0));
  RTCGeometry placed = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(placed, inner);
  rtcSetGeometryMask(placed, ~0u);
  w.add(placed);
  rtcCommitScene(w.scene);
  alignas(64) RTCRayHit8 p;
  alignas(64) int valid[8];
  std::memset(&p, 0, sizeof p);
  int expected = 0;
  calls = 0;
  for (int i = 0; i < 8; i++) {
    valid[i] = -1;
    // On the floor.
    p.ray.org_x[i] = p.ray.org_y[i] = .25f, p.ray.dir_z[i] = 1, p.ray.tfar[i] = INFINITY, p.ray.mask[i] = ~0u;
    p.hit.geomID[i] = p.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    RTCRayHit r = make_ray({.25f, .25f, 0}, {0, 0, 1});
    intersect(w.scene, r);
  }
  expected = calls, calls = 0;
  Query query;
  trace(valid, w.scene, query, &p);
  if (is_ours()) CHECK(expected == 8 && calls == expected);
  rtcReleaseScene(inner);
  rtcReleaseScene(deep);
}

void crowds() {
  ask_again();
  differ = all = 0;
  for (int round = 0; round < 60; round++) {
    World w(below(2) ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    stack(w, below(2) ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    for (int k = 0; k < 40; k++) packet<4>(w.scene, true, true), packet<8>(w.scene, true, true), packet<16>(w.scene, true, true);
  }
  int hits = 0;
  for (int round = 0; round < 150; round++) {
    const int flags = below(2) ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE;
    World w(flags);
    std::vector<RTCScene> scenes;
    for (unsigned i = 0; i < 1 + below(3); i++) scenes.push_back(inner(w, below(2) ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE));
    if (below(2)) w.add(w.floor(float(below(3))));
    const unsigned count = 1 + below(40);
    for (unsigned i = 0; i < count; i++) {
      RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(g, scenes[below(unsigned(scenes.size()))]);
      const Vec at = place(3);
      const float s = below(2) ? 1 : uniform(.2f, 2), a = below(2) ? 0 : uniform(-3, 3), mirrored = below(3) ? 1.f : -1.f;
      const float m[12] = {mirrored * s * std::cos(a), mirrored * s * std::sin(a), 0, -s * std::sin(a), s * std::cos(a), 0, 0, 0, s, at.x, at.y, at.z};
      rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
      rtcSetGeometryMask(g, below(6) ? ~0u : 1);
      w.add(g);
      if (below(4) == 0) {
        RTCGeometry twin = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(twin, scenes[0]);
        rtcSetGeometryTransform(twin, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
        rtcSetGeometryMask(twin, ~0u);
        w.add(twin);
      }
    }
#ifdef EMBREE4
    if (below(3) == 0) {
      RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE_ARRAY);
      rtcSetGeometryInstancedScene(g, scenes[0]);
      float(*m)[12] = (float(*)[12])rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_TRANSFORM, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, 48, 7);
      for (int i = 0; i < 7; i++) {
        const Vec at = place(3);
        const float own[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, at.x, at.y, at.z};
        std::memcpy(m[i], own, sizeof own);
      }
      rtcSetGeometryMask(g, ~0u);
      w.add(g);
    }
#endif
    for (RTCScene scene : scenes) rtcReleaseScene(scene);
    rtcCommitScene(w.scene);
    for (int k = 0; k < 20; k++)
      for (bool coherent : {true, true, false}) packet<4>(w.scene, coherent), packet<8>(w.scene, coherent), packet<16>(w.scene, coherent);
    RTCRayHit r = make_ray({.25f, .25f, -8}, {0, 0, 1});
    intersect(w.scene, r);
    hits += is_hit(r);
  }
  // Embree's packets and single rays differ by rounding, on edges, and in which of several things at one distance they find.
  CHECK(all > 100000 && (!is_ours() || differ == 0) && differ < all / 5);
  CHECK(hits > 10);
}
