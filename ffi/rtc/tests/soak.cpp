// Scenes are made, committed, asked and released, over and over: memory must not grow.
//
//   soak [CYCLES]     default 1,000,000
#ifdef EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

// Pages that the process holds.
static long resident() {
  long all = 0, held = 0;
  FILE* file = std::fopen("/proc/self/statm", "r");
  if (!file || std::fscanf(file, "%ld %ld", &all, &held) != 2) std::exit(2);
  std::fclose(file);
  return held;
}

static bool is_hit(RTCScene scene, float x) {
  RTCRayHit r;
  std::memset(&r, 0, sizeof r);
  r.ray.org_x = x, r.ray.org_y = 0.25f, r.ray.org_z = 5, r.ray.dir_z = -1, r.ray.tfar = INFINITY, r.ray.mask = ~0u;
  r.hit.geomID = r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#ifdef EMBREE4
  rtcIntersect1(scene, &r, nullptr);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &r);
#endif
  return r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
}

static bool cycle(RTCDevice device) {
  RTCScene child = rtcNewScene(device), scene = rtcNewScene(device);
  RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const float points[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const unsigned indices[] = {0, 1, 2};
  std::memcpy(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3), points, sizeof points);
  std::memcpy(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1), indices, sizeof indices);
  rtcCommitGeometry(mesh);
  rtcAttachGeometry(child, mesh);
  rtcCommitScene(child);
  rtcAttachGeometry(scene, mesh);
  rtcReleaseGeometry(mesh);
  RTCGeometry instance = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(instance, child);
  const float moved[] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 3, 0, 0};
  rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, moved);
  rtcCommitGeometry(instance);
  rtcAttachGeometry(scene, instance);
  rtcReleaseGeometry(instance);
  rtcReleaseScene(child);
  rtcCommitScene(scene);
  const bool right = is_hit(scene, 0.25f) && is_hit(scene, 3.25f) && !is_hit(scene, 2);
  rtcReleaseScene(scene);
  return right;
}

int main(int argc, char** argv) {
  const long cycles = argc > 1 ? std::atol(argv[1]) : 1000000;
  RTCDevice device = rtcNewDevice("threads=1");
  long before = 0;
  for (long i = 0; i < cycles; i++) {
    // What is kept for later is there by then.
    if (i == cycles / 10) before = resident();
    if (!cycle(device)) return std::puts("wrong hits"), 1;
  }
  const long grown = resident() - before;
  rtcReleaseDevice(device);
  std::printf("%ld cycles: grown by %ld pages\n", cycles, grown);
  return grown > 256;
}
