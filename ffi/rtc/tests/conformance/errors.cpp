// What goes wrong is told, and told once.
#include "check.h"

static RTCError told;
static std::vector<RTCError> calls;

static RTCError take(RTCDevice device) {
  const RTCError first = rtcGetDeviceError(device);
  CHECK(rtcGetDeviceError(device) == RTC_ERROR_NONE);
  return first;
}

// What is told of a buffer: where its items lie comes first, then type and slot, and in lists of them the format before the slot.
static void buffers() {
  World w;
  alignas(16) static float data[64];
  auto set = [&](RTCGeometryType type, RTCBufferType name, unsigned slot, RTCFormat format, size_t offset = 0, size_t stride = 16) {
    RTCGeometry g = rtcNewGeometry(w.device, type);
    rtcSetSharedGeometryBuffer(g, name, slot, format, data, offset, stride, 2);
    const RTCError error = take(w.device);
    rtcSetNewGeometryBuffer(g, name, slot, format, stride, 2);
    if (offset == 0) CHECK(take(w.device) == error);
    rtcReleaseGeometry(g);
    rtcGetDeviceError(w.device);
    return error;
  };
  const RTCGeometryType triangles = RTC_GEOMETRY_TYPE_TRIANGLE, discs = RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT;
  const RTCError argument = RTC_ERROR_INVALID_ARGUMENT, operation = RTC_ERROR_INVALID_OPERATION;
  CHECK(set(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3) == RTC_ERROR_NONE);
  CHECK(set(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 2) == operation);
  CHECK(set(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 0, 18) == operation);
  CHECK(set(triangles, RTC_BUFFER_TYPE_VERTEX, 1, RTC_FORMAT_FLOAT3) == argument);
  CHECK(set(triangles, RTC_BUFFER_TYPE_VERTEX, 1, RTC_FORMAT_FLOAT4) == operation);
  CHECK(set(triangles, RTC_BUFFER_TYPE_INDEX, 1, RTC_FORMAT_FLOAT3) == argument);
  CHECK(set(triangles, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_FLOAT3) == operation);
  CHECK(set(triangles, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UINT) == argument);
  CHECK(set(triangles, RTC_BUFFER_TYPE_NORMAL, 0, RTC_FORMAT_UINT) == argument);
  CHECK(set(triangles, RTC_BUFFER_TYPE_VERTEX_ATTRIBUTE, 0, RTC_FORMAT_FLOAT3) == operation);
  CHECK(set(RTC_GEOMETRY_TYPE_SPHERE_POINT, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3) == argument);
  CHECK(set(discs, RTC_BUFFER_TYPE_NORMAL, 1, RTC_FORMAT_FLOAT3) == operation);
  CHECK(set(RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UCHAR, 1, 1) == RTC_ERROR_NONE);
  CHECK(set(RTC_GEOMETRY_TYPE_USER, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3) == operation);

  // Interleaved with something that comes first: the last item ends where the buffer does.
  RTCBuffer buffer = rtcNewBuffer(w.device, 48);
  RTCGeometry g = rtcNewGeometry(w.device, triangles);
  rtcSetGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, buffer, 4, 16, 3);
  CHECK(take(w.device) == RTC_ERROR_NONE);
  const float points[12] = {7, 0, 0, 1, 7, 1, 0, 1, 7, 0, 1, 1};
  std::memcpy(rtcGetBufferData(buffer), points, sizeof points);
  const unsigned corners[3] = {0, 1, 2};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1), corners, sizeof corners);
  // Misaligned, and too far as well.
  rtcSetGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, buffer, 2, 16, 300);
  CHECK(take(w.device) == operation);
  rtcSetGeometryMask(g, ~0u);
  w.add(g);
  rtcReleaseBuffer(buffer);
  rtcCommitScene(w.scene);
  CHECK(near(shoot(w.scene, {0.25f, 0.25f, 3}, {0, 0, -1}).ray.tfar, 2));

  // Without bytes there is no memory.
  g = rtcNewGeometry(w.device, triangles);
  CHECK(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 16, 0) == nullptr);
  CHECK(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 0) != nullptr);
  buffer = rtcNewBuffer(w.device, 0);
  CHECK(buffer != nullptr && rtcGetBufferData(buffer) == nullptr && take(w.device) == RTC_ERROR_NONE);
  rtcReleaseBuffer(buffer);
  rtcReleaseGeometry(g);
}

// All steps have a buffer, or none has; with one stride.
static void steps() {
  World w;
  static float data[64];
  auto commit = [&](RTCGeometryType type, std::vector<size_t> strides, RTCBufferType name = RTC_BUFFER_TYPE_VERTEX) {
    RTCGeometry g = rtcNewGeometry(w.device, type);
    rtcSetGeometryTimeStepCount(g, 2);
    const RTCFormat format = type == RTC_GEOMETRY_TYPE_TRIANGLE || name == RTC_BUFFER_TYPE_NORMAL ? RTC_FORMAT_FLOAT3 : RTC_FORMAT_FLOAT4;
    for (unsigned i = 0; i < strides.size(); i++) {
      rtcSetSharedGeometryBuffer(g, name, i, format, data, 0, strides[i], 2);
      if (name == RTC_BUFFER_TYPE_NORMAL)
        for (unsigned k = 0; k < 2; k++) rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, k, RTC_FORMAT_FLOAT4, data, 0, 16, 2);
    }
    CHECK(take(w.device) == RTC_ERROR_NONE);
    rtcCommitGeometry(g);
    rtcReleaseGeometry(g);
    return take(w.device);
  };
  for (RTCGeometryType type : {RTC_GEOMETRY_TYPE_TRIANGLE, RTC_GEOMETRY_TYPE_SPHERE_POINT, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE}) {
    CHECK(commit(type, {}) == RTC_ERROR_NONE && commit(type, {16, 16}) == RTC_ERROR_NONE);
    CHECK(commit(type, {16}) == RTC_ERROR_INVALID_OPERATION && commit(type, {16, 32}) == RTC_ERROR_INVALID_OPERATION);
  }
  const RTCGeometryType discs = RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT;
  CHECK(commit(discs, {12, 12}, RTC_BUFFER_TYPE_NORMAL) == RTC_ERROR_NONE);
  CHECK(commit(discs, {12, 16}, RTC_BUFFER_TYPE_NORMAL) == RTC_ERROR_INVALID_OPERATION);
  CHECK(commit(discs, {12}, RTC_BUFFER_TYPE_NORMAL) == RTC_ERROR_INVALID_OPERATION);
}

static void devices() {
  World w, other;
  RTCGeometry g = other.floor(1);
  rtcCommitGeometry(g);
  CHECK(rtcAttachGeometry(w.scene, g) == RTC_INVALID_GEOMETRY_ID && take(w.device) == RTC_ERROR_INVALID_ARGUMENT);
  rtcAttachGeometryByID(w.scene, g, 7);
  CHECK(take(w.device) == RTC_ERROR_INVALID_ARGUMENT);
  RTCBuffer buffer = rtcNewBuffer(w.device, 48);
  rtcSetGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, buffer, 0, 12, 3);
  CHECK(take(other.device) == RTC_ERROR_INVALID_ARGUMENT);
  rtcReleaseBuffer(buffer);
  rtcReleaseGeometry(g);
}

static void numbers() {
  World w;
  for (int type : {-1, 3, 7, 14, 18, 23, 27, 31, 36, 45, 49, 53, 57, 61, 99, 119, 130}) {
    CHECK(rtcNewGeometry(w.device, RTCGeometryType(type)) == nullptr && take(w.device) == RTC_ERROR_UNKNOWN);
  }
  for (int property : {4, 31, 61, 95, 127, 1000, -1}) {
    CHECK(rtcGetDeviceProperty(w.device, RTCDeviceProperty(property)) == 0 && take(w.device) == RTC_ERROR_INVALID_ARGUMENT);
  }
  rtcDetachGeometry(w.scene, RTC_INVALID_GEOMETRY_ID);
  CHECK(take(w.device) == RTC_ERROR_INVALID_ARGUMENT);
  rtcDetachGeometry(w.scene, 5);
  CHECK(take(w.device) == RTC_ERROR_INVALID_OPERATION);

  RTCGeometry curves = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  rtcSetGeometryTessellationRate(curves, 4);
  CHECK(take(w.device) == RTC_ERROR_NONE);
  for (float scale : {2.0f, 0.5f}) {
    rtcSetGeometryMaxRadiusScale(curves, scale);
    CHECK(take(w.device) == RTC_ERROR_INVALID_OPERATION);
  }
  rtcReleaseGeometry(curves);
  RTCGeometry points = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
  rtcSetGeometryTessellationRate(points, 4);
  CHECK(take(w.device) == RTC_ERROR_INVALID_OPERATION);
  rtcSetNewGeometryBuffer(points, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, 1);
  rtcCommitGeometry(points);
  float value[4] = {9, 9, 9, 9};
  rtcInterpolate0(points, 0, 0, 0, RTC_BUFFER_TYPE_VERTEX, 0, value, 4);
  CHECK(take(w.device) == RTC_ERROR_INVALID_OPERATION && value[0] == 9);
  rtcReleaseGeometry(points);
  RTCGeometry instance = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
  float m[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  for (auto format : {RTC_FORMAT_FLOAT3X4_ROW_MAJOR, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR}) {
    rtcSetGeometryTransform(instance, 0, format, m);
    CHECK(take(w.device) == RTC_ERROR_NONE);
  }
  rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_ROW_MAJOR, m);
  CHECK(take(w.device) == RTC_ERROR_INVALID_OPERATION);
  rtcReleaseGeometry(instance);
}

// Where rays that are not numbers are to miss, a beginning that is none is of these.
static void no_beginning() {
  World w;
  w.add(w.floor(0));
  w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}}, {0, 1, 2}));
  rtcCommitScene(w.scene);
  if (!rtcGetDeviceProperty(w.device, RTC_DEVICE_PROPERTY_IGNORE_INVALID_RAYS_ENABLED)) return;
  RTCRayHit ray = make_ray({0.25f, 0.25f, 5}, {0, 0, -1});
  ray.ray.tnear = NAN;
  RTCRayHit hit = ray;
  intersect(w.scene, hit);
  CHECK(!is_hit(hit) && !occluded(w.scene, ray.ray));
  ray.ray.tnear = -1;
  intersect(w.scene, ray);
  CHECK(is_hit(ray));
}

void errors() {
  buffers();
  steps();
  devices();
  numbers();
  no_beginning();
  // Without a device.
  rtcGetDeviceError(nullptr);
  CHECK(rtcNewScene(nullptr) == nullptr && take(nullptr) == RTC_ERROR_INVALID_ARGUMENT);
  rtcCommitScene(nullptr);
  CHECK(take(nullptr) == RTC_ERROR_INVALID_ARGUMENT);

  // What Embree passes over, and what it does not.
  for (const char* good : {"", "verbose", "threads = 2", "verbose=-1", "threads=2;verbose=0", "threads=2x", "isa=avx2,nothing=1"}) {
    RTCDevice passing = rtcNewDevice(good);
    CHECK(passing && rtcGetDeviceError(passing) == RTC_ERROR_NONE);
    if (passing) rtcReleaseDevice(passing);
  }
  for (const char* bad : {"threads=abc", "verbose=x", "threads=", "threads=1.5"}) CHECK(!rtcNewDevice(bad) && rtcGetDeviceError(nullptr) == RTC_ERROR_UNKNOWN);
  RTCDevice device = rtcNewDevice("threads=2,verbose=0");
  CHECK(take(device) == RTC_ERROR_NONE);
  rtcSetDeviceErrorFunction(
      device, [](void* user, RTCError code, const char* text) {
        calls.push_back(code);
        CHECK(user == &told && text != nullptr);
      },
      &told);
  RTCScene scene = rtcNewScene(device);

  rtcDetachGeometry(scene, 5);
  CHECK(take(device) != RTC_ERROR_NONE && calls.size() == 1);

  RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, 3);
  CHECK(take(device) == RTC_ERROR_INVALID_OPERATION);
  rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 7, RTC_FORMAT_FLOAT3, 12, 3);
  CHECK(take(device) == RTC_ERROR_INVALID_ARGUMENT);
  rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 16, 3);
  CHECK(take(device) == RTC_ERROR_INVALID_OPERATION);
  rtcSetGeometryUserPrimitiveCount(g, 3);
  CHECK(take(device) == RTC_ERROR_INVALID_OPERATION);
  rtcSetGeometryTimeStepCount(g, 1000);
  CHECK(take(device) == RTC_ERROR_INVALID_ARGUMENT);
  rtcNewGeometry(device, RTCGeometryType(99));
  CHECK(take(device) == RTC_ERROR_UNKNOWN);

  // A geometry that was not committed, and one that is in a place already.
  rtcAttachGeometry(scene, g);
  rtcCommitScene(scene);
  CHECK(take(device) == RTC_ERROR_INVALID_OPERATION);
  rtcAttachGeometryByID(scene, g, 0);
  CHECK(take(device) != RTC_ERROR_NONE);
  rtcReleaseGeometry(g);

  // The first is kept.
  calls.clear();
  rtcSetGeometryTimeStepCount(g, 1000);
  rtcNewGeometry(device, RTCGeometryType(99));
  CHECK(calls.size() == 2 && take(device) == calls[0]);

  CHECK(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION) == RTC_VERSION);
  CHECK(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_TRIANGLE_GEOMETRY_SUPPORTED) == 1);
  CHECK(take(device) == RTC_ERROR_NONE);
  rtcReleaseScene(scene);

  // A commit that is cancelled, and the next, which is not.
  scene = rtcNewScene(device);
  World w;
  g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const float points[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3), points, 36);
  const unsigned indices[3] = {0, 1, 2};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1), indices, 12);
  rtcSetGeometryMask(g, ~0u);
  rtcCommitGeometry(g);
  rtcAttachGeometry(scene, g);
  rtcSetSceneProgressMonitorFunction(scene, [](void*, double) { return false; }, nullptr);
  rtcCommitScene(scene);
  CHECK(take(device) == RTC_ERROR_CANCELLED);
  rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
  rtcCommitScene(scene);
  CHECK(take(device) == RTC_ERROR_NONE && is_hit(shoot(scene, {0.2f, 0.2f, 1}, {0, 0, -1})));
  // Indices beyond the vertices, and vertices that are no numbers, are not hit.
  ((unsigned*)rtcGetGeometryBufferData(g, RTC_BUFFER_TYPE_INDEX, 0))[1] = 77;
  rtcCommitGeometry(g);
  rtcCommitScene(scene);
  CHECK(take(device) == RTC_ERROR_NONE && !is_hit(shoot(scene, {0.2f, 0.2f, 1}, {0, 0, -1})));
  rtcReleaseGeometry(g);
  rtcReleaseScene(scene);
  CHECK(take(device) == RTC_ERROR_NONE);
  rtcReleaseDevice(device);
}
