// Triangles, quads, grids, instances and motion: what u, v, Ng and ids are.
#include "check.h"

static std::mt19937 random_(7);
static float uniform(float a, float b) { return std::uniform_real_distribution<float>(a, b)(random_); }

static void triangles() {
  World w;
  const Vec a{0, 0, 0}, b{2, 0, 0.5f}, c{0, 3, 1};
  unsigned id = w.add(w.triangle(a, b, c));
  rtcCommitScene(w.scene);
  for (int i = 0; i < 100; i++) {
    float u = uniform(0.01f, 0.98f), v = uniform(0.01f, 0.99f - u);
    Vec p = (1 - u - v) * a + u * b + v * c, o{uniform(-3, 3), uniform(-3, 3), uniform(2, 9)};
    RTCRayHit r = shoot(w.scene, o, p - o);
    CHECK(r.hit.geomID == id && r.hit.primID == 0 && r.hit.instID[0] == RTC_INVALID_GEOMETRY_ID);
    CHECK(near(r.ray.tfar, 1) && near(r.hit.u, u) && near(r.hit.v, v));
    CHECK(near(normal(r), cross(b - a, c - a)));
    // From behind the same.
    CHECK(near(normal(shoot(w.scene, p + (p - o), o - p)), cross(b - a, c - a)));
    CHECK(!is_hit(shoot(w.scene, o, p - o, 0.999f)));
    CHECK(!is_hit(shoot(w.scene, o, o - p)));
  }
}

static void quads() {
  World w;
  const Vec a{0, 0, 0}, b{2, 0, 0}, c{2.5f, 2, 0}, d{0, 1.5f, 0};
  w.add(w.mesh(RTC_GEOMETRY_TYPE_QUAD, {{a, b, c, d}}, {0, 1, 2, 3}));
  rtcCommitScene(w.scene);
  for (int i = 0; i < 100; i++) {
    float u = uniform(0.01f, 0.99f), v = uniform(0.01f, 0.99f);
    if (std::fabs(u + v - 1) < 0.01f) continue;
    bool first = u + v < 1;
    Vec p = first ? a + u * (b - a) + v * (d - a) : c + (1 - u) * (d - c) + (1 - v) * (b - c);
    RTCRayHit r = shoot(w.scene, p + Vec{0.1f, 0.2f, 3}, Vec{-0.1f, -0.2f, -3});
    CHECK(is_hit(r) && r.hit.primID == 0 && near(r.hit.u, u) && near(r.hit.v, v));
    CHECK(near(normal(r), first ? cross(b - a, d - a) : cross(d - c, b - c)));
  }
}

static void grids() {
  World w;
  const unsigned width = 4, height = 3, stride = 5;
  std::vector<Vec> points;
  for (unsigned y = 0; y < height; y++)
    for (unsigned x = 0; x < stride; x++) points.push_back({float(x), float(y), 0.25f * x * y});
  RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_GRID);
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, points.size()), points.data(),
              12 * points.size());
  auto* grid = (RTCGrid*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_GRID, 0, RTC_FORMAT_GRID, sizeof(RTCGrid), 1);
  grid->startVertexID = 0, grid->stride = stride, grid->width = width, grid->height = height;
  rtcSetGeometryMask(g, ~0u);
  w.add(g);
  rtcCommitScene(w.scene);
  for (int i = 0; i < 100; i++) {
    float x = uniform(0, width - 1.01f), y = uniform(0, height - 1.01f);
    RTCRayHit r = shoot(w.scene, {x, y, 9}, {0, 0, -1});
    CHECK(is_hit(r) && r.hit.primID == 0);
    CHECK(near(r.hit.u, x / (width - 1)) && near(r.hit.v, y / (height - 1)));
    CHECK(r.hit.Ng_z > 0);
    float p[3], du[3], dv[3];
    rtcInterpolate1(rtcGetGeometry(w.scene, 0), 0, r.hit.u, r.hit.v, RTC_BUFFER_TYPE_VERTEX, 0, p, du, dv, 3);
    CHECK(near(Vec{p[0], p[1], p[2]}, Vec{x, y, 9 - r.ray.tfar}));
  }
  CHECK(!is_hit(shoot(w.scene, {3.5f, 1, 9}, {0, 0, -1})));
}

static void interpolation() {
  World w;
  const std::vector<Vec> p{{0, 0, 0}, {2, 0, 1}, {3, 2, 0}, {0, 1, 5}};
  unsigned t = w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {p}, {0, 1, 3}));
  unsigned q = w.add(w.mesh(RTC_GEOMETRY_TYPE_QUAD, {p}, {0, 1, 2, 3}));
  for (int i = 0; i < 20; i++) {
    float u = uniform(0, 0.5f), v = uniform(0, 0.5f), out[3], du[3], dv[3];
    for (unsigned id : {t, q}) {
      rtcInterpolate1(rtcGetGeometry(w.scene, id), 0, u, v, RTC_BUFFER_TYPE_VERTEX, 0, out, du, dv, 3);
      CHECK(near(Vec{out[0], out[1], out[2]}, (1 - u - v) * p[0] + u * p[1] + v * p[3]));
      CHECK(near(Vec{du[0], du[1], du[2]}, p[1] - p[0]) && near(Vec{dv[0], dv[1], dv[2]}, p[3] - p[0]));
    }
    rtcInterpolate1(rtcGetGeometry(w.scene, q), 0, 1 - u, 1 - v, RTC_BUFFER_TYPE_VERTEX, 0, out, du, dv, 3);
    CHECK(near(Vec{out[0], out[1], out[2]}, (1 - u - v) * p[2] + u * p[3] + v * p[1]));
    CHECK(near(Vec{du[0], du[1], du[2]}, p[2] - p[3]) && near(Vec{dv[0], dv[1], dv[2]}, p[2] - p[1]));
  }
}

static void instances() {
  World w;
  RTCScene child = rtcNewScene(w.device);
  unsigned inner = w.add(w.floor(0), child);
  rtcCommitScene(child);
  RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(g, child);
  rtcSetGeometryMask(g, ~0u);
  // Turned about x (y to z, z to -y), twice as large, moved.
  const float m[12] = {2, 0, 0, 0, 0, 2, 0, -2, 0, 10, 20, 30};
  rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
  w.add(w.floor(-100));
  unsigned outer = w.add(g);
  rtcReleaseScene(child);
  rtcCommitScene(w.scene);
  // (0.25, 0.25, 0) stands at (10.5, 20, 30.5); its z axis points to -y.
  RTCRayHit r = shoot(w.scene, {10.5f, 13, 30.5f}, {0, 1, 0});
  CHECK(r.hit.instID[0] == outer && r.hit.geomID == inner && near(r.ray.tfar, 7));
  CHECK(near(r.hit.u, 0.25f) && near(r.hit.v, 0.25f) && near(normal(r), Vec{0, 0, 1}));
  CHECK(r.ray.org_y == 13 && r.ray.dir_y == 1);
  float back[16];
  rtcGetGeometryTransform(rtcGetGeometry(w.scene, outer), 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, back);
  CHECK(back[0] == 2 && back[6] == -2 && back[9] == 2 && back[3] == 10 && back[7] == 20 && back[11] == 30);
  rtcGetGeometryTransform(rtcGetGeometry(w.scene, outer), 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, back);
  CHECK(back[0] == 2 && back[6] == 2 && back[9] == -2 && back[12] == 10 && back[14] == 30 && back[15] == 1);
  RTCBounds b;
  rtcGetSceneBounds(w.scene, &b);
  CHECK(near(b.lower_z, -100) && near(b.upper_x, 12) && near(b.upper_z, 32) && near(b.upper_y, 20));
}

static void motion() {
  World w;
  auto at = [](float z) { return std::vector<Vec>{{0, 0, z}, {1, 0, z}, {0, 1, z}, {1, 1, z}}; };
  w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {at(0), at(4), at(2)}, {0, 1, 2}));
  unsigned q = w.add(w.mesh(RTC_GEOMETRY_TYPE_QUAD, {at(-1), at(-3)}, {0, 1, 3, 2}));
  RTCScene child = rtcNewScene(w.device);
  w.add(w.floor(0), child);
  rtcCommitScene(child);
  RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(g, child);
  rtcSetGeometryTimeStepCount(g, 2);
  rtcSetGeometryMask(g, ~0u);
  for (int i = 0; i < 2; i++) {
    const float m[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, float(5 + 2 * i), 0, 0};
    rtcSetGeometryTransform(g, i, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
  }
  unsigned moving = w.add(g);
  rtcReleaseScene(child);
  rtcCommitScene(w.scene);
  for (float time : {0.f, 0.25f, 0.5f, 0.75f, 1.f}) {
    float z = time < 0.5f ? 8 * time : 4 - 4 * (time - 0.5f);
    CHECK(near(shoot(w.scene, {0.25f, 0.25f, 10}, {0, 0, -1}, INFINITY, time).ray.tfar, 10 - z));
    RTCRayHit r = shoot(w.scene, {0.75f, 0.75f, 10}, {0, 0, -1}, INFINITY, time);
    CHECK(r.hit.geomID == q && near(r.ray.tfar, 11 + 2 * time) && near(r.hit.u, 0.75f));
    RTCRayHit i = shoot(w.scene, {5.1f + 2 * time, 0.2f, 1}, {0, 0, -1}, INFINITY, time);
    CHECK(i.hit.instID[0] == moving && near(i.hit.u, 0.1f));
  }
  RTCLinearBounds b;
  rtcGetSceneLinearBounds(w.scene, &b);
  CHECK(near(b.bounds0.lower_z, -1) && near(b.bounds1.lower_z, -3));
  CHECK(near(b.bounds0.upper_x, 6) && near(b.bounds1.upper_x, 8));
  // The middle step sticks out above the line from 0 to 2 by 3.
  CHECK(near(b.bounds0.upper_z, 3) && near(b.bounds1.upper_z, 5));
}

static void ranges() {
  World w;
  auto at = [](float z) { return std::vector<Vec>{{0, 0, z}, {1, 0, z}, {0, 1, z}}; };
  RTCGeometry g = w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {at(0), at(1)}, {0, 1, 2});
  rtcSetGeometryTimeRange(g, 0.25f, 0.5f);
  w.add(g);
  rtcCommitScene(w.scene);
  CHECK(near(shoot(w.scene, {0.25f, 0.25f, 10}, {0, 0, -1}, INFINITY, 0.375f).ray.tfar, 9.5f));
  CHECK(!is_hit(shoot(w.scene, {0.25f, 0.25f, 10}, {0, 0, -1}, INFINITY, 0.1f)));
  CHECK(!is_hit(shoot(w.scene, {0.25f, 0.25f, 10}, {0, 0, -1}, INFINITY, 0.6f)));
}

#ifdef EMBREE4
// Several places of two scenes in one geometry.
static void arrays() {
  World w;
  RTCScene scenes[2];
  for (int i = 0; i < 2; i++) {
    scenes[i] = rtcNewScene(w.device);
    w.add(w.floor(i ? 5 : 0), scenes[i]);
    rtcCommitScene(scenes[i]);
  }
  RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE_ARRAY);
  rtcSetGeometryInstancedScenes(g, scenes, 2);
  auto* which = (unsigned*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, 4, 3);
  auto* places = (float*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_TRANSFORM, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, 48, 3);
  for (unsigned i = 0; i < 3; i++) {
    const float m[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 10.f * i, 0, 0};
    std::memcpy(places + 12 * i, m, 48);
    which[i] = i == 1;
  }
  rtcSetGeometryMask(g, ~0u);
  unsigned id = w.add(g);
  rtcCommitScene(w.scene);
  for (unsigned i = 0; i < 3; i++) {
    RTCRayHit r = shoot(w.scene, {10.f * i + 0.25f, 0.25f, 20}, {0, 0, -1});
    CHECK(r.hit.instID[0] == id && r.hit.instPrimID[0] == i && r.hit.geomID == 0 && near(r.ray.tfar, i == 1 ? 15 : 20));
    float back[12];
    rtcGetGeometryTransformEx(rtcGetGeometry(w.scene, id), i, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, back);
    CHECK(back[0] == 1 && back[9] == 10.f * i);
  }
  for (RTCScene scene : scenes) rtcReleaseScene(scene);
}
#endif

void surfaces() {
#ifdef EMBREE4
  arrays();
#endif
  triangles();
  quads();
  grids();
  interpolation();
  instances();
  motion();
  ranges();
}
