// Where rays begin: a triangle there counts in robust scenes alone. And what the process begins with: exceptions, arrays that are not there, forks.
#include "check.h"
#include <stdexcept>
#include <sys/wait.h>
#include <unistd.h>

// Triangles, quads and a grid at height 0, seen from there and from above.
static RTCGeometry flat(World& w, RTCGeometryType type) {
  const std::vector<Vec> corners = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  if (type == RTC_GEOMETRY_TYPE_TRIANGLE) return w.mesh(type, {corners}, {0, 1, 2, 0, 2, 3});
  if (type == RTC_GEOMETRY_TYPE_QUAD) return w.mesh(type, {corners}, {0, 1, 2, 3});
  RTCGeometry g = rtcNewGeometry(w.device, type);
  const std::vector<Vec> rows = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 4), rows.data(), 48);
  const RTCGrid grid = {0, 2, 2, 2};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_GRID, 0, RTC_FORMAT_GRID, 12, 1), &grid, 12);
  rtcSetGeometryMask(g, ~0u);
  return g;
}

static RTCRayHit from(Vec org, float tnear, float tfar = INFINITY) {
  RTCRayHit r = make_ray(org, {0, 0, -1}, tfar);
  r.ray.tnear = tnear;
  return r;
}

static bool hits(RTCScene scene, const RTCRayHit& ray) {
  RTCRayHit r = ray, o = ray;
  intersect(scene, r);
  CHECK(occluded(scene, o.ray) == is_hit(r));
  return is_hit(r);
}

static void at_the_start(bool robust, RTCGeometryType type, bool placed) {
  const int flags = robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE;
  World w(flags);
  RTCScene inner = rtcNewScene(w.device);
  rtcSetSceneFlags(inner, RTCSceneFlags(flags));
  w.add(flat(w, type), placed ? inner : nullptr);
  rtcCommitScene(inner);
  if (placed) {
    RTCGeometry in = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(in, inner);
    rtcSetGeometryMask(in, ~0u);
    w.add(in);
  }
  rtcReleaseScene(inner);
  w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {{{0, 0, -1}, {3, 0, -1}, {0, 3, -1}}}, {0, 1, 2}));
  rtcCommitScene(w.scene);
  for (float tnear : {0.f, 0.5f, 2.f}) {
    // Where t is rounded, what lies at the start may be before it.
    if (tnear > 0 && !is_exact()) continue;
    // On the first, with the second below; or with nothing below within reach.
    const Vec at{0.3f, 0.4f, tnear};
    CHECK(hits(w.scene, from(at, tnear)));
    RTCRayHit r = from(at, tnear);
    intersect(w.scene, r);
    CHECK(near(r.ray.tfar, robust ? tnear : tnear + 1));
    CHECK(hits(w.scene, from(at, tnear, tnear + 0.5f)) == robust);
    if (tnear > 0) CHECK(hits(w.scene, from(at, tnear - 0.25f, tnear + 0.5f)));
  }
  // Four rays, of which two begin there.
  RTCRayHit4 four;
  std::memset(&four, 0, sizeof four);
  alignas(16) const int valid[4] = {-1, -1, -1, -1};
  for (int i = 0; i < 4; i++) {
    four.ray.org_x[i] = four.ray.org_y[i] = 0.25f, four.ray.org_z[i] = i % 2, four.ray.dir_z[i] = -1;
    four.ray.tfar[i] = 0.5f + i % 2, four.ray.mask[i] = ~0u;
    four.hit.geomID[i] = four.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCRay4 shadow = four.ray;
  Query query;
#ifdef EMBREE4
  rtcIntersect4(valid, w.scene, &four, &query.intersect);
  rtcOccluded4(valid, w.scene, &shadow, &query.occluded);
#else
  rtcIntersect4(valid, w.scene, &query.context, &four);
  rtcOccluded4(valid, w.scene, &query.context, &shadow);
#endif
  for (int i = 0; i < 4; i++) {
    const bool expected = i % 2 || robust;
    CHECK((four.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) == expected && (shadow.tfar[i] < 0) == expected);
  }
}

// An error function may throw what its program catches.
static void exceptions() {
  RTCDevice device = rtcNewDevice(nullptr);
  rtcSetDeviceErrorFunction(device, [](void*, RTCError, const char* text) { throw std::runtime_error(text); }, nullptr);
  int caught = 0;
  for (int i = 0; i < 3; i++) {
    try {
      rtcNewGeometry(device, RTCGeometryType(0xabc));
    } catch (const std::runtime_error& error) {
      caught += *error.what() != 0;
    }
  }
  CHECK(caught == 3);
  rtcSetDeviceErrorFunction(device, nullptr, nullptr);
  rtcGetDeviceError(device);
  rtcReleaseDevice(device);
}

#ifndef EMBREE4
// Of a stream in arrays those may be missing that nobody needs.
static void missing_arrays() {
  World w;
  w.add(w.floor(0));
  rtcCommitScene(w.scene);
  const unsigned n = 11;
  std::vector<float> zero(n, 0), quarter(n, 0.25f), five(n, 5), down(n, -1), far(n, 100), u(n), v(n);
  std::vector<unsigned> id(n, 0), flags(n, 0), prim(n), geom(n, RTC_INVALID_GEOMETRY_ID);
  RTCRayHitNp r;
  std::memset(&r, 0, sizeof r);
  r.ray.org_x = r.ray.org_y = quarter.data(), r.ray.org_z = five.data();
  r.ray.dir_x = r.ray.dir_y = zero.data(), r.ray.dir_z = down.data(), r.ray.tfar = far.data();
  r.ray.id = id.data(), r.ray.flags = flags.data();
  r.hit.u = u.data(), r.hit.v = v.data(), r.hit.primID = prim.data(), r.hit.geomID = geom.data();
  Query query;
  rtcIntersectNp(w.scene, &query.context, &r, n);
  for (unsigned i = 0; i < n; i++) CHECK(geom[i] == 0 && prim[i] == 0 && near(far[i], 5) && near(u[i], 0.25f));
  std::fill(far.begin(), far.end(), 100.f);
  rtcOccludedNp(w.scene, &query.context, &r.ray, n);
  for (unsigned i = 0; i < n; i++) CHECK(far[i] < 0);
}
#endif

// A process that was forked commits scenes as well, on the device that it found and on one of its own.
static void forks() {
  World w;
  std::vector<Vec> points;
  std::vector<unsigned> indices;
  for (unsigned i = 0; i < 20000; i++) {
    const float x = i % 100, y = i / 100;
    points.insert(points.end(), {{x, y, 0}, {x + 1, y, 0}, {x, y + 1, 0}});
    indices.insert(indices.end(), {3 * i, 3 * i + 1, 3 * i + 2});
  }
  w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {points}, indices));
  rtcCommitScene(w.scene);
  // By a pipe: under valgrind the child's exit code says that it has lost what only threads held that it does not have.
  int told[2];
  CHECK(pipe(told) == 0);
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    alarm(20);
    char good = 0;
    for (const char* config : {"", "threads=2"}) {
      RTCDevice device = *config ? rtcNewDevice(config) : w.device;
      RTCScene scene = rtcNewScene(device);
      RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
      std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, points.size()), points.data(), 12 * points.size());
      std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 20000), indices.data(), 12 * 20000);
      rtcSetGeometryMask(g, ~0u);
      rtcCommitGeometry(g);
      rtcAttachGeometry(scene, g);
      rtcReleaseGeometry(g);
      rtcCommitScene(scene);
      RTCRayHit r = make_ray({50.25f, 20.25f, 5}, {0, 0, -1});
      intersect(scene, r);
      good += is_hit(r) && r.hit.primID == 2050;
      rtcReleaseScene(scene);
      if (*config) rtcReleaseDevice(device);
    }
    _exit(write(told[1], &good, 1) == 1 ? 0 : 1);
  }
  close(told[1]);
  char good = 0;
  CHECK(read(told[0], &good, 1) == 1 && good == 2);
  close(told[0]);
  waitpid(child, nullptr, 0);
}

// A grid without cells has nothing to hit, and does no harm.
static void empty_grids() {
  World w;
  RTCGeometry g = rtcNewGeometry(w.device, RTC_GEOMETRY_TYPE_GRID);
  const std::vector<Vec> rows = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 4), rows.data(), 48);
  const RTCGrid grids[2] = {{0, 2, 0, 0}, {0, 2, 2, 2}};
  std::memcpy(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_GRID, 0, RTC_FORMAT_GRID, 12, 2), grids, 24);
  rtcSetGeometryMask(g, ~0u);
  w.add(g);
  rtcCommitScene(w.scene);
  const RTCRayHit r = shoot(w.scene, {0.25f, 0.25f, 5}, {0, 0, -1});
  CHECK(is_hit(r) && r.hit.primID == 1);
}

void starts() {
  for (bool robust : {false, true})
    for (RTCGeometryType type : {RTC_GEOMETRY_TYPE_TRIANGLE, RTC_GEOMETRY_TYPE_QUAD, RTC_GEOMETRY_TYPE_GRID})
      for (bool placed : {false, true}) at_the_start(robust, type, placed);
  exceptions();
#ifndef EMBREE4
  missing_arrays();
#endif
  forks();
  empty_grids();
}
