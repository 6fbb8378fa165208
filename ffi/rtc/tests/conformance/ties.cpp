// Things of every kind at exactly the same distance: the lowest geometry is hit, and of it the lowest primitive, however they were built.
#include "check.h"

namespace {

enum Kind { STILL, MOVING, QUADS, SPHERES, DISCS, CURVES, INSTANCE, KINDS };

// Two primitives at height 1, of which each is met at (0.25, 0.25) by rays down at time 0.5.
RTCGeometry thing(World& w, Kind kind, RTCScene inner) {
  const std::vector<unsigned> twice = {0, 1, 2, 0, 1, 2};
  switch (kind) {
    case STILL: return w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}}, twice);
    case MOVING: return w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 2}, {1, 0, 2}, {0, 1, 2}}}, twice);
    case QUADS: return w.mesh(RTC_GEOMETRY_TYPE_QUAD, {{{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}}, {0, 1, 2, 3, 0, 1, 2, 3});
    case INSTANCE: {
      RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(g, inner);
      rtcSetGeometryMask(g, ~0u);
      return g;
    }
    default: break;
  }
  const RTCGeometryType type = kind == SPHERES ? RTC_GEOMETRY_TYPE_SPHERE_POINT
                               : kind == DISCS ? RTC_GEOMETRY_TYPE_DISC_POINT
                                               : RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE;
  RTCGeometry g = rtcNewGeometry(w.device, type);
  const float z = kind == DISCS ? 1 : 0;
  // A curve's first segment is met beside its end, and so is its twin.
  const float points[4][4] = {{0.25f, 0.25f, z, 1}, {0.25f, kind == CURVES ? 3.25f : 0.25f, z, 1}, {0.25f, 0.25f, z, 1}, {0.25f, 3.25f, z, 1}};
  const unsigned count = kind == CURVES ? 4 : 2;
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, count), points, 16 * count);
  if (kind == CURVES) {
    const unsigned starts[2] = {0, 2};
    std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, 4, 2), starts, 8);
  }
  rtcSetGeometryMask(g, ~0u);
  return g;
}

}  // namespace

void ties() {
  unsigned state = 1;
  auto below = [&](unsigned n) { return state = state * 1664525 + 1013904223, (state >> 16) % n; };
  for (int round = 0; round < 200; round++) {
    World w(below(2) ? RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(w.scene, RTCBuildQuality(below(3)));
    RTCScene inner = rtcNewScene(w.device);
    for (unsigned i = 0; i < 3; i++) w.add(thing(w, Kind(below(INSTANCE)), nullptr), inner);
    rtcCommitScene(inner);
    const unsigned count = 2 + below(4);
    for (unsigned i = 0; i < count; i++) {
      const Kind kind = Kind(below(KINDS));
      RTCGeometry g = thing(w, kind, inner);
      // What accepts everything changes nothing.
      if (kind != INSTANCE && below(4) == 0) rtcSetGeometryIntersectFilterFunction(g, [](const RTCFilterFunctionNArguments*) {});
      w.add(g);
    }
    rtcReleaseScene(inner);
    rtcCommitScene(w.scene);
    for (unsigned gone = 0; gone < count; gone++) {
      RTCRayHit r = shoot(w.scene, {0.25f, 0.25f, 9}, {0, 0, -1}, INFINITY, 0.5f);
      CHECK(is_hit(r) && near(r.ray.tfar, 8));
      if (is_ours()) {
        const bool placed = r.hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
        CHECK((placed ? r.hit.instID[0] : r.hit.geomID) == gone);
        CHECK((!placed || r.hit.geomID == 0) && r.hit.primID == 0);
      }
      rtcDetachGeometry(w.scene, gone);
      if (gone + 1 < count) rtcCommitScene(w.scene);
    }
  }
}
