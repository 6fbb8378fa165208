// Scenes that change: updates, recommits, ids, enabling; and masks.
#include "check.h"

#include <atomic>
#include <set>
#include <thread>

static float height(RTCScene scene) {
  RTCRayHit r = shoot(scene, {0.25f, 0.25f, 100}, {0, 0, -1});
  return is_hit(r) ? 100 - r.ray.tfar : NAN;
}

static void updates() {
  for (int flags : {0, int(RTC_SCENE_FLAG_DYNAMIC), int(RTC_SCENE_FLAG_ROBUST), int(RTC_SCENE_FLAG_COMPACT)})
    for (RTCBuildQuality quality : {RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_MEDIUM, RTC_BUILD_QUALITY_HIGH}) {
      World w(flags);
      rtcSetSceneBuildQuality(w.scene, quality);
      RTCGeometry g = w.floor(1);
      rtcRetainGeometry(g);
      unsigned id = w.add(g);
      rtcCommitScene(w.scene);
      CHECK(near(height(w.scene), 1));
      auto* points = (Vec*)rtcGetGeometryBufferData(g, RTC_BUFFER_TYPE_VERTEX, 0);
      for (int i = 0; i < 3; i++) points[i].z = 2;
      rtcUpdateGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0);
      rtcCommitGeometry(g);
      rtcCommitScene(w.scene);
      CHECK(near(height(w.scene), 2));
      rtcDisableGeometry(g);
      rtcCommitScene(w.scene);
      CHECK(std::isnan(height(w.scene)));
      rtcEnableGeometry(g);
      rtcCommitScene(w.scene);
      CHECK(near(height(w.scene), 2));
      // A shared buffer with offset and stride.
      static float data[1 + 3 * 5 + 4];
      for (int i = 0; i < 3; i++) data[1 + 5 * i] = i == 1, data[2 + 5 * i] = i == 2, data[3 + 5 * i] = 3;
      rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, data, 4, 20, 3);
      rtcCommitGeometry(g);
      rtcCommitScene(w.scene);
      CHECK(near(height(w.scene), 3));
      rtcDetachGeometry(w.scene, id);
      rtcCommitScene(w.scene);
      CHECK(std::isnan(height(w.scene)));
      rtcReleaseGeometry(g);
    }
}

static void ids() {
  World w;
  CHECK(w.add(w.floor(1)) == 0 && w.add(w.floor(2)) == 1 && w.add(w.floor(3)) == 2);
  rtcDetachGeometry(w.scene, 1);
  CHECK(rtcGetGeometry(w.scene, 1) == nullptr && rtcGetGeometry(w.scene, 2) != nullptr);
  CHECK(w.add(w.floor(4)) == 1);
  RTCGeometry g = w.floor(5);
  rtcSetGeometryUserData(g, &w);
  rtcCommitGeometry(g);
  rtcAttachGeometryByID(w.scene, g, 17);
  rtcReleaseGeometry(g);
  rtcCommitScene(w.scene);
  RTCRayHit r = shoot(w.scene, {0.25f, 0.25f, 100}, {0, 0, -1});
  CHECK(r.hit.geomID == 17 && near(r.ray.tfar, 95) && rtcGetGeometryUserData(rtcGetGeometry(w.scene, 17)) == &w);
}

// The lowest id that is free, whatever was attached and taken out before.
static void free_ids() {
  World w;
  RTCGeometry g = w.floor(1);
  rtcCommitGeometry(g);
  std::set<unsigned> used;
  std::mt19937 random(5);
  for (int i = 0; i < 2000; i++) {
    const unsigned id = random() % 40;
    const bool is_used = used.count(id);
    if (is_used && random() % 2) {
      rtcDetachGeometry(w.scene, id);
      used.erase(id);
    } else if (!is_used && random() % 4 == 0) {
      rtcAttachGeometryByID(w.scene, g, id);
      used.insert(id);
    } else if (used.size() < 40) {
      unsigned lowest = 0;
      while (used.count(lowest)) lowest++;
      CHECK(rtcAttachGeometry(w.scene, g) == lowest);
      used.insert(lowest);
    }
  }
  rtcReleaseGeometry(g);
}

// What was committed stands until the geometry is committed again.
static void uncommitted() {
  World w;
  RTCScene base = rtcNewScene(w.device);
  w.add(w.floor(0), base);
  rtcCommitScene(base);
  RTCGeometry in = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE), floor = w.floor(-5), other = w.floor(-6);
  rtcSetGeometryInstancedScene(in, base);
  rtcSetGeometryMask(in, ~0u);
  rtcReleaseScene(base);
  for (RTCGeometry g : {in, floor, other}) rtcCommitGeometry(g), rtcAttachGeometry(w.scene, g);
  rtcCommitScene(w.scene);
  CHECK(near(height(w.scene), 0));
  // Moved away, but not yet.
  const float m[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 100, 0, 0};
  rtcSetGeometryTransform(in, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
  rtcCommitScene(w.scene);
#ifdef EMBREE4
  // Embree 4 has rays go through the new transform at once.
  if (is_ours())
#endif
  CHECK(near(height(w.scene), 0));
  float back[12];
  rtcGetGeometryTransform(in, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, back);
  CHECK(back[9] == 100);
  rtcCommitGeometry(in);
  rtcCommitScene(w.scene);
  CHECK(near(height(w.scene), -5));
  // A buffer that takes another's place.
  const Vec higher[3] = {{0, 0, -4}, {1, 0, -4}, {0, 1, -4}};
  rtcSetSharedGeometryBuffer(floor, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, higher, 0, 12, 3);
  rtcCommitScene(w.scene);
  CHECK(near(height(w.scene), -5));
  rtcCommitGeometry(floor);
  rtcCommitScene(w.scene);
  CHECK(near(height(w.scene), -4));
  // One of another number of primitives waits for a commit.
  static const unsigned twice[6] = {0, 1, 2, 0, 1, 2};
  rtcSetSharedGeometryBuffer(floor, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, twice, 0, 12, 1);
  rtcCommitScene(w.scene);
  const RTCError of_one = rtcGetDeviceError(w.device);
#ifdef EMBREE4
  // Embree 4 has any index buffer wait for one.
  if (is_ours())
#endif
  CHECK(of_one == RTC_ERROR_NONE && near(height(w.scene), -4));
  rtcSetSharedGeometryBuffer(floor, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, twice, 0, 12, 2);
  rtcCommitScene(w.scene);
  CHECK(rtcGetDeviceError(w.device) == RTC_ERROR_INVALID_OPERATION);
  rtcCommitGeometry(floor);
  rtcCommitScene(w.scene);
  CHECK(rtcGetDeviceError(w.device) == RTC_ERROR_NONE && near(height(w.scene), -4));
  // What is as it was.
  rtcSetGeometryTimeStepCount(floor, 1);
  rtcCommitScene(w.scene);
  CHECK(near(height(w.scene), -4));
  // But a mask may be another one.
  rtcSetGeometryMask(floor, ~0u);
  rtcCommitScene(w.scene);
  CHECK(rtcGetDeviceError(w.device) == RTC_ERROR_INVALID_OPERATION && std::isnan(height(w.scene)));
  for (RTCGeometry g : {in, floor, other}) rtcReleaseGeometry(g);
}

// Bounds are those of what was committed, of which there is none any more once geometries came or went.
static void bounds_of_changed() {
  World w;
  RTCGeometry g = w.floor(3);
  rtcCommitGeometry(g);
  auto told = [&] {
    RTCBounds all;
    RTCLinearBounds linear;
    all.lower_x = linear.bounds0.lower_x = -77;
    rtcGetSceneBounds(w.scene, &all);
    const RTCError first = rtcGetDeviceError(w.device);
    rtcGetSceneLinearBounds(w.scene, &linear);
    CHECK(rtcGetDeviceError(w.device) == first);
    CHECK((all.lower_x == -77) == (first != RTC_ERROR_NONE) && (linear.bounds0.lower_x == -77) == (first != RTC_ERROR_NONE));
    return first;
  };
  CHECK(told() == RTC_ERROR_INVALID_OPERATION);
  rtcCommitScene(w.scene);
  CHECK(told() == RTC_ERROR_NONE);
  rtcAttachGeometry(w.scene, g);
  CHECK(told() == RTC_ERROR_INVALID_OPERATION);
  rtcCommitScene(w.scene);
  rtcCommitGeometry(g);
  CHECK(told() == RTC_ERROR_NONE);
  rtcDetachGeometry(w.scene, 0);
  CHECK(told() == RTC_ERROR_INVALID_OPERATION);
  rtcCommitScene(w.scene);
  CHECK(told() == RTC_ERROR_NONE);
  rtcReleaseGeometry(g);
}

static void masks() {
  World w;
  for (unsigned i = 0; i < 3; i++) {
    RTCGeometry g = w.floor(i + 1);
    rtcSetGeometryMask(g, 1u << i);
    w.add(g);
  }
  rtcCommitScene(w.scene);
  for (unsigned mask = 0; mask < 8; mask++) {
    RTCRayHit r = shoot(w.scene, {0.25f, 0.25f, 100}, {0, 0, -1}, INFINITY, 0, mask);
    unsigned expected = mask & 4 ? 2 : mask & 2 ? 1 : mask & 1 ? 0 : RTC_INVALID_GEOMETRY_ID;
    CHECK(r.hit.geomID == expected);
  }
  // All alike, and a ray that sees none of them.
  for (unsigned i = 0; i < 3; i++) {
    rtcSetGeometryMask(rtcGetGeometry(w.scene, i), 2);
    rtcCommitGeometry(rtcGetGeometry(w.scene, i));
  }
  rtcCommitScene(w.scene);
  CHECK(!is_hit(shoot(w.scene, {0.25f, 0.25f, 100}, {0, 0, -1}, INFINITY, 0, 5)));
  CHECK(is_hit(shoot(w.scene, {0.25f, 0.25f, 100}, {0, 0, -1}, INFINITY, 0, 7)));
}

static void bounds() {
  World w;
  w.add(w.floor(3));
  rtcCommitScene(w.scene);
  RTCBounds b;
  rtcGetSceneBounds(w.scene, &b);
  CHECK(b.lower_x == 0 && b.upper_x == 1 && b.upper_y == 1 && b.lower_z == 3 && b.upper_z == 3);
}

static void joins() {
  World w;
  std::vector<Vec> points;
  std::vector<unsigned> indices;
  for (unsigned i = 0; i < 3000; i++) {
    points.insert(points.end(), {{0, 0, i * 1e-3f}, {1, 0, i * 1e-3f}, {0, 1, i * 1e-3f}});
    indices.insert(indices.end(), {3 * i, 3 * i + 1, 3 * i + 2});
  }
  w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {points}, indices));
  std::atomic<int> right{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; i++)
    threads.emplace_back([&] {
      rtcJoinCommitScene(w.scene);
      RTCRayHit r = make_ray({0.25f, 0.25f, 100}, {0, 0, -1});
      intersect(w.scene, r);
      right += r.hit.primID == 2999;
    });
  for (auto& thread : threads) thread.join();
  CHECK(right == 4);
}

static void monitors() {
  World w;
  static ssize_t held;
  held = 0;
  rtcSetDeviceMemoryMonitorFunction(
      w.device, [](void*, ssize_t bytes, bool) { return held += bytes, true; }, nullptr);
  static int calls;
  calls = 0;
  rtcSetSceneProgressMonitorFunction(
      w.scene, [](void*, double n) { return calls++, n >= 0 && n <= 1; }, nullptr);
  RTCGeometry g = w.floor(1);
  rtcRetainGeometry(g);
  w.add(g);
  rtcCommitScene(w.scene);
  CHECK(calls > 0 && held > 0);
  rtcReleaseGeometry(g);
  rtcSetSceneProgressMonitorFunction(w.scene, nullptr, nullptr);
}

void changes() {
  updates();
  ids();
  free_ids();
  uncommitted();
  bounds_of_changed();
  masks();
  bounds();
  joins();
  monitors();
}
