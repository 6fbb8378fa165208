// Packets and streams answer as single rays do, lane by lane, and leave other lanes alone.
#include "check.h"

static std::mt19937 random_(11);
static float uniform(float a, float b) { return std::uniform_real_distribution<float>(a, b)(random_); }

struct Same {
  int differ = 0, all = 0;
  // Embree's packets and single rays may differ on an edge.
  void add(bool same) { all++, differ += !same; }
};

static bool same(const RTCRayHit& a, const RTCRayHit& b) {
  return a.hit.geomID == b.hit.geomID && (!is_hit(a) || (a.hit.primID == b.hit.primID && near(a.ray.tfar, b.ray.tfar) &&
                                                         near(a.hit.u, b.hit.u) && near(a.hit.v, b.hit.v)));
}

template <int N, class RayHitN, class RayN> static void packet(RTCScene scene, bool coherent, Same& tally, void (*closest)(const int*, RTCScene, Query&, RayHitN*),
                                                  void (*any)(const int*, RTCScene, Query&, RayN*)) {
  RTCDevice device = rtcGetSceneDevice(scene);
  const bool has_sixteen = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED);
  rtcReleaseDevice(device);
  alignas(64) int valid[N];
  RTCRayHit single[N];
  RayHitN packet;
  std::memset(&packet, 0, sizeof packet);
  for (int i = 0; i < N; i++) {
    valid[i] = uniform(0, 1) < 0.8f ? -1 : 0;
    Vec o = coherent ? Vec{0, 0, 5} : Vec{uniform(-3, 3), uniform(-3, 3), uniform(-3, 3)};
    single[i] = make_ray(o, Vec{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)} - o, INFINITY);
    const RTCRay& r = single[i].ray;
    packet.ray.org_x[i] = r.org_x, packet.ray.org_y[i] = r.org_y, packet.ray.org_z[i] = r.org_z;
    packet.ray.dir_x[i] = r.dir_x, packet.ray.dir_y[i] = r.dir_y, packet.ray.dir_z[i] = r.dir_z;
    packet.ray.tfar[i] = r.tfar, packet.ray.mask[i] = ~0u;
    packet.hit.geomID[i] = packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RayN rays = packet.ray;
  Query query;
#ifdef EMBREE4
  if (coherent) query.intersect.flags = query.occluded.flags = RTC_RAY_QUERY_FLAG_COHERENT;
#else
  if (coherent) query.context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
#endif
  closest(valid, scene, query, &packet);
  any(valid, scene, query, &rays);
  for (int i = 0; i < N; i++) {
    if (!valid[i]) {
      // Embree makes a stream of sixteen that it cannot trace together, and traces them all.
      if (N == 16 && !is_ours() && !has_sixteen) continue;
      CHECK(packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID && packet.ray.tfar[i] == INFINITY && rays.tfar[i] == INFINITY);
      continue;
    }
    intersect(scene, single[i]);
    RTCRayHit r = single[i];
    r.ray.tfar = packet.ray.tfar[i], r.hit.geomID = packet.hit.geomID[i], r.hit.primID = packet.hit.primID[i];
    r.hit.u = packet.hit.u[i], r.hit.v = packet.hit.v[i];
    tally.add(same(r, single[i]));
    tally.add((rays.tfar[i] < 0) == is_hit(single[i]));
  }
}

#ifdef EMBREE4
#define CLOSEST(N) [](const int* v, RTCScene s, Query& q, RTCRayHit##N* r) { rtcIntersect##N(v, s, r, &q.intersect); }
#define ANY(N) [](const int* v, RTCScene s, Query& q, RTCRay##N* r) { rtcOccluded##N(v, s, r, &q.occluded); }
#else
#define CLOSEST(N) [](const int* v, RTCScene s, Query& q, RTCRayHit##N* r) { rtcIntersect##N(v, s, &q.context, r); }
#define ANY(N) [](const int* v, RTCScene s, Query& q, RTCRay##N* r) { rtcOccluded##N(v, s, &q.context, r); }
#endif

#ifndef EMBREE4
static void streams(RTCScene scene, Same& tally) {
  const unsigned n = 37;
  std::vector<RTCRayHit> single(n), stream(n), listed(n);
  std::vector<RTCRayHit*> list;
  struct Wide {
    RTCRayHit r;
    char more[16];
  };
  for (unsigned i = 0; i < n; i++) {
    Vec o{uniform(-3, 3), uniform(-3, 3), uniform(-3, 3)};
    single[i] = stream[i] = listed[i] = make_ray(o, Vec{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)} - o);
    list.push_back(&listed[i]);
    intersect(scene, single[i]);
  }
  std::vector<Wide> wide(n);
  for (unsigned i = 0; i < n; i++) wide[i].r = stream[i];
  // One array a component.
  std::vector<float> words[20];
  for (unsigned i = 0; i < n; i++)
    for (int k = 0; k < 20; k++) words[k].push_back(((const float*)&stream[i])[k]);
  RTCRayHitNp np;
  float* all[20];
  for (int k = 0; k < 20; k++) all[k] = words[k].data();
  static_assert(sizeof np == sizeof all);
  std::memcpy(&np, all, sizeof np);
  Query query;
  rtcIntersect1M(scene, &query.context, &wide[0].r, n, sizeof(Wide));
  rtcIntersect1Mp(scene, &query.context, list.data(), n);
  rtcIntersectNp(scene, &query.context, &np, n);
  alignas(64) static float packets[2][20][8];
  for (int p = 0; p < 2; p++)
    for (int k = 0; k < 20; k++)
      for (int i = 0; i < 8; i++) packets[p][k][i] = ((const float*)&stream[8 * p + i])[k];
  rtcIntersectNM(scene, &query.context, (RTCRayHitN*)packets, 8, 2, sizeof packets[0]);
  for (unsigned i = 0; i < n; i++) {
    tally.add(same(wide[i].r, single[i]));
    tally.add(same(listed[i], single[i]));
    RTCRayHit r;
    for (int k = 0; k < 20; k++) ((float*)&r)[k] = words[k][i];
    tally.add(same(r, single[i]));
    if (i >= 16) continue;
    for (int k = 0; k < 20; k++) ((float*)&r)[k] = packets[i / 8][k][i % 8];
    tally.add(same(r, single[i]));
  }
}
#endif

void packets() {
  for (int with_mask = 0; with_mask < 2; with_mask++) {
    World w(RTC_SCENE_FLAG_ROBUST);
    std::vector<Vec> points;
    std::vector<unsigned> indices;
    for (unsigned i = 0; i < 300; i++) {
      Vec c{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      for (int k = 0; k < 3; k++) points.push_back(c + Vec{uniform(-.3f, .3f), uniform(-.3f, .3f), uniform(-.3f, .3f)});
      indices.insert(indices.end(), {3 * i, 3 * i + 1, 3 * i + 2});
    }
    w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {points}, indices));
    if (with_mask) {
      RTCGeometry g = w.floor(0.1f);
      rtcSetGeometryMask(g, 1);
      w.add(g);
    }
    rtcCommitScene(w.scene);
    Same tally;
    for (int i = 0; i < 200; i++)
      for (bool coherent : {false, true}) {
        packet<4, RTCRayHit4, RTCRay4>(w.scene, coherent, tally, CLOSEST(4), ANY(4));
        packet<8, RTCRayHit8, RTCRay8>(w.scene, coherent, tally, CLOSEST(8), ANY(8));
        packet<16, RTCRayHit16, RTCRay16>(w.scene, coherent, tally, CLOSEST(16), ANY(16));
      }
#ifndef EMBREE4
    for (int i = 0; i < 20; i++) streams(w.scene, tally);
#endif
    CHECK(tally.all > 10000 && tally.differ <= tally.all / 2000);
  }
}
