// Points and round linear curves.
#include "check.h"

static RTCGeometry of(World& w, RTCGeometryType type, const std::vector<float>& balls, const std::vector<Vec>& normals = {},
                      const std::vector<unsigned>& segments = {}) {
  RTCGeometry g = rtcNewGeometry(w.device, type);
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, balls.size() / 4), balls.data(),
              4 * balls.size());
  if (!normals.empty())
    std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_NORMAL, 0, RTC_FORMAT_FLOAT3, 12, normals.size()), normals.data(),
                12 * normals.size());
  if (!segments.empty())
    std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, 4, segments.size()), segments.data(),
                4 * segments.size());
  rtcSetGeometryMask(g, ~0u);
  return g;
}

static void spheres() {
  World w;
  w.add(of(w, RTC_GEOMETRY_TYPE_SPHERE_POINT, {0, 0, 0, 1, 5, 0, 0, 2}));
  rtcCommitScene(w.scene);
  RTCRayHit r = shoot(w.scene, {0.6f, 0, 10}, {0, 0, -2});
  CHECK(r.hit.primID == 0 && near(r.ray.tfar, 4.6f) && r.hit.u == 0 && r.hit.v == 0);
  CHECK(near(normal(r), Vec{0.6f, 0, 0.8f}));
  r = shoot(w.scene, {5, 0, 0}, {0, 1, 0});
  CHECK(r.hit.primID == 1 && near(r.ray.tfar, 2) && near(normal(r), Vec{0, 2, 0}));
  CHECK(!is_hit(shoot(w.scene, {1.01f, 0, 10}, {0, 0, -1})));
}

static void discs() {
  World w;
  w.add(of(w, RTC_GEOMETRY_TYPE_DISC_POINT, {0, 0, 0, 1}));
  w.add(of(w, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT, {5, 0, 0, 1}, {{0, 1, 1}}));
  rtcCommitScene(w.scene);
  RTCRayHit r = shoot(w.scene, {0.9f, 0, 10}, {0, 0, -2});
  CHECK(r.hit.geomID == 0 && near(r.ray.tfar, 5) && near(normal(r), Vec{0, 0, 2}));
  CHECK(!is_hit(shoot(w.scene, {1.1f, 0, 10}, {0, 0, -2})));
  // Discs that face the ray do not shade themselves: they are hit from outside of the ball around them.
  for (Vec inside : {Vec{0, 0, 0.95f}, Vec{0.5f, 0, 0.85f}, Vec{0.9f, 0, 0.4f}}) {
    CHECK(!is_hit(shoot(w.scene, inside, {0, 0, -1})));
    CHECK(is_hit(shoot(w.scene, inside + Vec{0, 0, 0.1f}, {0, 0, -1})));
  }
  r = shoot(w.scene, {5, 0.5f, 0.5f}, {0, 0, -1});
  CHECK(r.hit.geomID == 1 && near(r.ray.tfar, 1));
  r = shoot(w.scene, {5, 0.5f, 10}, {0, 0, -2});
  CHECK(r.hit.geomID == 1 && near(r.ray.tfar, 5.25f) && near(normal(r), Vec{0, 1, 1}));
  CHECK(!is_hit(shoot(w.scene, {5, 0.8f, 10}, {0, 0, -2})));
}

static void curves() {
  World w;
  // A cylinder of radius 1 along x from 0 to 4, then on to 8; and a cone from radius 2 to 1 far away.
  unsigned id = w.add(of(w, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE, {0, 0, 0, 1, 4, 0, 0, 1, 8, 0, 0, 1}, {}, {0, 1}));
  w.add(of(w, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE, {0, 50, 0, 2, 10, 50, 0, 1}, {}, {0}));
  rtcCommitScene(w.scene);
  for (float x : {0.5f, 1.f, 3.f, 5.f, 7.5f}) {
    RTCRayHit r = shoot(w.scene, {x, 0, 10}, {0, 0, -1});
    CHECK(r.hit.geomID == id && r.hit.primID == (x > 4) && near(r.ray.tfar, 9));
    CHECK(near(r.hit.u, (x > 4 ? x - 4 : x) / 4) && r.hit.v == 0);
    const Vec n = normal(r);
    CHECK(near((1 / length(n)) * n, Vec{0, 0, 1}));
  }
  // The cap.
  RTCRayHit r = shoot(w.scene, {-0.6f, 0, 10}, {0, 0, -1});
  CHECK(r.hit.primID == 0 && near(r.ray.tfar, 9.2f) && near(r.hit.u, 0));
  CHECK(!is_hit(shoot(w.scene, {-1.1f, 0, 10}, {0, 0, -1})));
  // Along the axis, into one cap.
  CHECK(near(shoot(w.scene, {20, 0, 0}, {-1, 0, 0}).ray.tfar, 11));
  // The cone: the distance to it of a place in its side is that of a tangent to both circles. At x on the axis, the side is
  // (2 - x / 10) / cos a high, where sin a = 1 / 10.
  for (float x : {2.f, 5.f, 8.f})
    CHECK(near(shoot(w.scene, {x, 50, 20}, {0, 0, -1}).ray.tfar, 20 - (2 - x / 10) / std::sqrt(0.99f)));
}

void rounds() {
  spheres();
  discs();
  curves();
}
