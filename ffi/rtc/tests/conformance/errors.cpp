// What goes wrong is told, and told once.
#include "check.h"

static RTCError told;
static std::vector<RTCError> calls;

static RTCError take(RTCDevice device) {
  const RTCError first = rtcGetDeviceError(device);
  CHECK(rtcGetDeviceError(device) == RTC_ERROR_NONE);
  return first;
}

void errors() {
  // Without a device.
  rtcGetDeviceError(nullptr);
  CHECK(rtcNewScene(nullptr) == nullptr && take(nullptr) == RTC_ERROR_INVALID_ARGUMENT);
  rtcCommitScene(nullptr);
  CHECK(take(nullptr) == RTC_ERROR_INVALID_ARGUMENT);

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
