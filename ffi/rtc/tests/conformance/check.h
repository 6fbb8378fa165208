// What the tests share: both versions' interface under one name, and checks that count.
//
// Each test says what the interface's documentation or a closed form says, so the program must pass on Embree as well as on our library.
#pragma once

#ifdef EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <random>
#include <vector>

struct Vec {
  float x, y, z;
};
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(float s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline float length(Vec a) { return std::sqrt(dot(a, a)); }

extern int checks, failures;

// Whether it is the library that stands in for Embree, as scripts/test-dropin.sh tells: for what Embree itself does not keep.
inline bool is_ours() { return std::getenv("CONFORMANCE_OURS") != nullptr; }

inline bool check_(bool holds, const char* what, const char* file, int line) {
  checks++;
  if (!holds) {
    failures++;
    std::printf("%s:%d: %s\n", std::strrchr(file, '/') ? std::strrchr(file, '/') + 1 : file, line, what);
  }
  return holds;
}
#define CHECK(condition) check_((condition), #condition, __FILE__, __LINE__)
// Within 1e-5 of the larger magnitude, or of 1.
inline bool near(float a, float b) { return std::fabs(a - b) <= 1e-5f * std::fmax(1.f, std::fmax(std::fabs(a), std::fabs(b))); }
inline bool near(Vec a, Vec b) { return near(a.x, b.x) && near(a.y, b.y) && near(a.z, b.z); }

// A query of either version.
struct Query {
#ifdef EMBREE4
  RTCRayQueryContext context;
  RTCIntersectArguments intersect;
  RTCOccludedArguments occluded;
  Query() {
    rtcInitRayQueryContext(&context);
    rtcInitIntersectArguments(&intersect);
    rtcInitOccludedArguments(&occluded);
    intersect.context = occluded.context = &context;
  }
  void filter(RTCFilterFunctionN f) {
    intersect.filter = occluded.filter = f;
    intersect.flags = occluded.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
  }
#else
  RTCIntersectContext context;
  Query() { rtcInitIntersectContext(&context); }
  void filter(RTCFilterFunctionN f) { context.filter = f; }
#endif
};

inline RTCRayHit make_ray(Vec org, Vec dir, float tfar = INFINITY, float time = 0, unsigned mask = ~0u) {
  RTCRayHit r;
  std::memset(&r, 0, sizeof r);
  r.ray.org_x = org.x, r.ray.org_y = org.y, r.ray.org_z = org.z;
  r.ray.dir_x = dir.x, r.ray.dir_y = dir.y, r.ray.dir_z = dir.z;
  r.ray.tfar = tfar, r.ray.time = time, r.ray.mask = mask;
  r.hit.geomID = r.hit.primID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return r;
}
inline void intersect(RTCScene scene, RTCRayHit& r, Query* query = nullptr) {
  Query own;
  if (!query) query = &own;
#ifdef EMBREE4
  rtcIntersect1(scene, &r, &query->intersect);
#else
  rtcIntersect1(scene, &query->context, &r);
#endif
}
inline bool occluded(RTCScene scene, RTCRay& r, Query* query = nullptr) {
  Query own;
  if (!query) query = &own;
#ifdef EMBREE4
  rtcOccluded1(scene, &r, &query->occluded);
#else
  rtcOccluded1(scene, &query->context, &r);
#endif
  return r.tfar < 0;
}
// The nearest hit of a ray.
inline RTCRayHit shoot(RTCScene scene, Vec org, Vec dir, float tfar = INFINITY, float time = 0, unsigned mask = ~0u) {
  RTCRayHit r = make_ray(org, dir, tfar, time, mask);
  intersect(scene, r);
  RTCRayHit o = make_ray(org, dir, tfar, time, mask);
  CHECK(occluded(scene, o.ray) == (r.hit.geomID != RTC_INVALID_GEOMETRY_ID));
  return r;
}
inline bool is_hit(const RTCRayHit& r) { return r.hit.geomID != RTC_INVALID_GEOMETRY_ID; }
inline Vec normal(const RTCRayHit& r) { return {r.hit.Ng_x, r.hit.Ng_y, r.hit.Ng_z}; }

// A scene that frees itself.
struct World {
  RTCDevice device;
  RTCScene scene;
  explicit World(int flags = 0) : device(rtcNewDevice(nullptr)), scene(rtcNewScene(device)) {
    rtcSetSceneFlags(scene, RTCSceneFlags(flags));
  }
  ~World() {
    CHECK(rtcGetDeviceError(device) == RTC_ERROR_NONE);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  // Commits and attaches a geometry, and gives it up.
  unsigned add(RTCGeometry g, RTCScene to = nullptr) {
    rtcCommitGeometry(g);
    unsigned id = rtcAttachGeometry(to ? to : scene, g);
    rtcReleaseGeometry(g);
    return id;
  }
  RTCGeometry mesh(RTCGeometryType type, const std::vector<std::vector<Vec>>& steps, const std::vector<unsigned>& indices) {
    RTCGeometry g = rtcNewGeometry(device, type);
    if (steps.size() > 1) rtcSetGeometryTimeStepCount(g, steps.size());
    for (unsigned i = 0; i < steps.size(); i++)
      std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, i, RTC_FORMAT_FLOAT3, 12, steps[i].size()),
                  steps[i].data(), 12 * steps[i].size());
    const unsigned n = type == RTC_GEOMETRY_TYPE_QUAD ? 4 : 3;
    const RTCFormat format = n == 4 ? RTC_FORMAT_UINT4 : RTC_FORMAT_UINT3;
    std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, format, 4 * n, indices.size() / n), indices.data(),
                4 * indices.size());
    rtcSetGeometryMask(g, ~0u);
    return g;
  }
  RTCGeometry triangle(Vec a, Vec b, Vec c) { return mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {{a, b, c}}, {0, 1, 2}); }
  // A triangle around (0.25, 0.25, z), which rays down from above meet.
  RTCGeometry floor(float z) { return triangle({0, 0, z}, {1, 0, z}, {0, 1, z}); }
};

// Whether t comes out to the bit where all numbers are small and whole. Embree multiplies by an approximate reciprocal, which on some processors (AMD's without
// AVX-512) is off in the last place.
inline bool is_exact() {
  World w(RTC_SCENE_FLAG_ROBUST);
  w.add(w.floor(0));
  rtcCommitScene(w.scene);
  const bool exact = shoot(w.scene, {0.25f, 0.25f, 5}, {0, 0, -1}).ray.tfar == 5;
  CHECK(exact || !is_ours());
  return exact;
}
