// Scenes that are dynamic, of which little changes from one commit to the next: against what is there, in closed form.
#include "check.h"

#include <algorithm>

namespace {

// A level sheet over the unit square, of n x n cells.
struct Sheet {
  RTCGeometry geometry;
  unsigned id;
  int n;
  float z;
  unsigned mask;
  bool is_enabled, is_seen, is_moving;
};

class Stack {
 public:
  explicit Stack(unsigned seed, int flags) : w_(flags | RTC_SCENE_FLAG_DYNAMIC), random_(seed) {}
  ~Stack() {
    for (Sheet& sheet : sheets_) rtcReleaseGeometry(sheet.geometry);
  }

  // Changes something, or nothing.
  void change() {
    const unsigned what = random_() % 10;
    if (sheets_.empty() || (what == 0 && sheets_.size() < 12)) return add();
    Sheet& sheet = sheets_[random_() % sheets_.size()];
    switch (what) {
      case 1:
        rtcDetachGeometry(w_.scene, sheet.id);
        rtcReleaseGeometry(sheet.geometry);
        sheet = sheets_.back();
        return sheets_.pop_back();
      case 2:
        sheet.is_enabled = !sheet.is_enabled;
        return sheet.is_enabled ? rtcEnableGeometry(sheet.geometry) : rtcDisableGeometry(sheet.geometry);
      case 3:
        sheet.mask = 1 + random_() % 7;
        rtcSetGeometryMask(sheet.geometry, sheet.mask);
        return rtcCommitGeometry(sheet.geometry);
      case 4: {
        sheet.is_seen = !sheet.is_seen;
        RTCFilterFunctionN filter = nullptr;
        if (!sheet.is_seen)
          filter = [](const RTCFilterFunctionNArguments* a) {
            for (unsigned i = 0; i < a->N; i++) a->valid[i] = 0;
          };
        rtcSetGeometryIntersectFilterFunction(sheet.geometry, filter);
        rtcSetGeometryOccludedFilterFunction(sheet.geometry, filter);
        return rtcCommitGeometry(sheet.geometry);
      }
      case 5:
        rtcSetGeometryBuildQuality(sheet.geometry, RTCBuildQuality(random_() % 4));
        return rtcCommitGeometry(sheet.geometry);
      case 6:
        // Triangles that cannot be hit, or can be again.
        static_cast<Vec*>(rtcGetGeometryBufferData(sheet.geometry, RTC_BUFFER_TYPE_VERTEX, 0))->x = random_() % 2 ? NAN : 0;
        rtcUpdateGeometryBuffer(sheet.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
        return rtcCommitGeometry(sheet.geometry);
      default:
        return move(sheet);
    }
  }

  // The same sheet a few times, as in an animation.
  void animate() {
    for (int i = 0; i < 3 && !sheets_.empty(); i++) {
      move(sheets_.back());
      check();
    }
  }

  void check() {
    rtcCommitScene(w_.scene);
    RTCRayHit8 eight;
    alignas(32) int valid[8];
    for (int i = 0; i < 8; i++) {
      const Vec org{0.3f + 0.6f * unit(), 0.3f + 0.6f * unit(), 100};
      const unsigned mask = i % 2 ? ~0u : 1 + random_() % 7;
      const RTCRayHit r = shoot(w_.scene, org, {0, 0, -1}, INFINITY, 0, mask);
      const Sheet* nearest = nullptr;
      for (const Sheet& sheet : sheets_)
        if (sheet.is_enabled && sheet.is_seen && (sheet.mask & mask) && (!nearest || sheet.z > nearest->z)) nearest = &sheet;
      CHECK(is_hit(r) == (nearest != nullptr));
      if (nearest && is_hit(r)) {
        CHECK(near(100 - r.ray.tfar, nearest->z));
        // Of those at the same height, the lowest; Embree takes any.
        for (const Sheet& sheet : sheets_)
          if (is_ours() && sheet.is_enabled && sheet.is_seen && (sheet.mask & mask) && sheet.z == nearest->z)
            CHECK(r.hit.geomID <= sheet.id);
      }
      valid[i] = -1;
      eight.ray.org_x[i] = org.x, eight.ray.org_y[i] = org.y, eight.ray.org_z[i] = org.z, eight.ray.tnear[i] = 0;
      eight.ray.dir_x[i] = 0, eight.ray.dir_y[i] = 0, eight.ray.dir_z[i] = -1, eight.ray.time[i] = 0;
      eight.ray.tfar[i] = INFINITY, eight.ray.mask[i] = mask, eight.ray.flags[i] = 0;
      eight.hit.geomID[i] = eight.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      expected_[i] = r.ray.tfar;
    }
    Query query;
#ifdef EMBREE4
    rtcIntersect8(valid, w_.scene, &eight, &query.intersect);
#else
    rtcIntersect8(valid, w_.scene, &query.context, &eight);
#endif
    for (int i = 0; i < 8; i++) CHECK(eight.ray.tfar[i] == expected_[i] || near(eight.ray.tfar[i], expected_[i]));
    float low = INFINITY, high = -INFINITY;
    for (const Sheet& sheet : sheets_)
      if (sheet.is_enabled) low = std::fmin(low, sheet.z), high = std::fmax(high, sheet.z);
    RTCBounds bounds;
    rtcGetSceneBounds(w_.scene, &bounds);
    if (high >= low) CHECK(near(bounds.lower_z, low) && near(bounds.upper_z, high));
  }

 private:
  float unit() { return (random_() >> 8) * 0x1p-24f; }

  void add() {
    Sheet sheet{nullptr, 0, 4 + int(random_() % 30), 0, ~0u, true, true, random_() % 6 == 0};
    const bool has_quads = random_() % 3 == 0;
    std::vector<Vec> points;
    std::vector<unsigned> indices;
    for (int j = 0; j <= sheet.n; j++)
      for (int i = 0; i <= sheet.n; i++) points.push_back({float(i) / sheet.n, float(j) / sheet.n, 0});
    for (unsigned j = 0; j < unsigned(sheet.n); j++)
      for (unsigned i = 0; i < unsigned(sheet.n); i++) {
        const unsigned a = j * (sheet.n + 1) + i, b = a + 1, c = b + sheet.n + 1, d = c - 1;
        if (has_quads)
          indices.insert(indices.end(), {a, b, c, d});
        else
          indices.insert(indices.end(), {a, b, c, a, c, d});
      }
    std::vector<std::vector<Vec>> steps(sheet.is_moving ? 2 : 1, points);
    sheet.geometry = w_.mesh(has_quads ? RTC_GEOMETRY_TYPE_QUAD : RTC_GEOMETRY_TYPE_TRIANGLE, steps, indices);
    rtcSetGeometryBuildQuality(sheet.geometry, RTCBuildQuality(random_() % 4));
    sheet.id = rtcAttachGeometry(w_.scene, sheet.geometry);
    move(sheet);
    sheets_.push_back(sheet);
  }

  void move(Sheet& sheet) {
    sheet.z = int(random_() % 64) / 8.f;
    for (int step = 0; step <= int(sheet.is_moving); step++) {
      auto* points = static_cast<Vec*>(rtcGetGeometryBufferData(sheet.geometry, RTC_BUFFER_TYPE_VERTEX, step));
      for (int i = 0; i < (sheet.n + 1) * (sheet.n + 1); i++) points[i].z = sheet.z;
      rtcUpdateGeometryBuffer(sheet.geometry, RTC_BUFFER_TYPE_VERTEX, step);
    }
    rtcCommitGeometry(sheet.geometry);
  }

  World w_;
  std::mt19937 random_;
  std::vector<Sheet> sheets_;
  float expected_[8];
};

// Little by little.
void stacks() {
  for (unsigned seed = 0; seed < 12; seed++) {
    Stack stack(seed, seed % 2 ? RTC_SCENE_FLAG_ROBUST : 0);
    for (int step = 0; step < 150; step++) {
      stack.change();
      stack.check();
      if (step % 10 == 0) stack.animate();
    }
  }
}

// Everything is given back, whatever was kept from one commit to the next; and a commit that fails keeps nothing.
void accounts() {
  static ssize_t held;
  held = 0;
  RTCDevice device = rtcNewDevice(nullptr);
  rtcSetDeviceMemoryMonitorFunction(
      device, [](void*, ssize_t bytes, bool) { return held += bytes, true; }, nullptr);
  {
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_DYNAMIC);
    const Vec points[6] = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {0, 0, 2}, {1, 0, 2}, {0, 1, 2}};
    const unsigned indices[3] = {0, 1, 2};
    RTCGeometry both[2];
    for (int i = 0; i < 2; i++) {
      both[i] = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
      std::memcpy(rtcSetNewGeometryBuffer(both[i], RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3), points + 3 * i, 36);
      std::memcpy(rtcSetNewGeometryBuffer(both[i], RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1), indices, 12);
      rtcSetGeometryMask(both[i], ~0u);
      rtcCommitGeometry(both[i]);
      rtcAttachGeometry(scene, both[i]);
    }
    for (int i = 0; i < 5; i++) {
      rtcCommitGeometry(both[1]);
      rtcCommitScene(scene);
      CHECK(shoot(scene, {0.25f, 0.25f, 9}, {0, 0, -1}).hit.geomID == 1);
    }
    // Not committed: nothing is there, and after that all of it again.
    rtcSetGeometryMask(both[1], ~0u);
    rtcCommitScene(scene);
    CHECK(rtcGetDeviceError(device) == RTC_ERROR_INVALID_OPERATION);
    CHECK(!is_hit(shoot(scene, {0.25f, 0.25f, 9}, {0, 0, -1})));
    rtcCommitGeometry(both[1]);
    rtcCommitScene(scene);
    CHECK(shoot(scene, {0.25f, 0.25f, 9}, {0, 0, -1}).hit.geomID == 1);
    rtcDisableGeometry(both[1]);
    rtcCommitScene(scene);
    CHECK(shoot(scene, {0.25f, 0.25f, 9}, {0, 0, -1}).hit.geomID == 0);
    for (RTCGeometry g : both) rtcReleaseGeometry(g);
    rtcReleaseScene(scene);
  }
  CHECK(held == 0);
  rtcReleaseDevice(device);
}

// What is kept from one commit to the next is not announced again: a monitor that has just enough room does not refuse it.
void announcements() {
  static ssize_t held, peak;
  held = peak = 0;
  World w(RTC_SCENE_FLAG_DYNAMIC);
  std::vector<Vec> points;
  std::vector<unsigned> indices;
  for (unsigned i = 0; i < 20000; i++) {
    const float x = i % 141 / 141.f, y = i / 141 / 142.f;
    points.insert(points.end(), {{x, y, 0}, {x + 0.01f, y, 0}, {x, y + 0.01f, 0}});
    indices.insert(indices.end(), {3 * i, 3 * i + 1, 3 * i + 2});
  }
  w.add(w.mesh(RTC_GEOMETRY_TYPE_TRIANGLE, {points}, indices));
  RTCGeometry little = w.floor(1);
  rtcRetainGeometry(little);
  w.add(little);
  rtcSetDeviceMemoryMonitorFunction(
      w.device, [](void*, ssize_t bytes, bool) { return held += bytes, peak = std::max(peak, held), true; }, nullptr);
  for (int i = 0; i < 4; i++) {
    const ssize_t before = held;
    peak = held;
    rtcCommitGeometry(little);
    rtcCommitScene(w.scene);
    if (is_ours() && i > 1) CHECK(peak < before + 10000 && held < before + 10000);
  }
  rtcReleaseGeometry(little);
}

// At the same distance the lowest geometry is hit whatever has changed last, though filters look at both and accept them.
void accepted_ties() {
  for (int filtered = 0; filtered < 4; filtered++) {
    World w(RTC_SCENE_FLAG_DYNAMIC);
    static int asked;
    for (int i = 0; i < 2; i++) {
      RTCGeometry g = w.floor(1);
      if (filtered >> i & 1) rtcSetGeometryIntersectFilterFunction(g, [](const RTCFilterFunctionNArguments*) { asked++; });
      w.add(g);
    }
    for (int changed = -1; changed < 6; changed++) {
      if (changed >= 0) rtcCommitGeometry(rtcGetGeometry(w.scene, changed / 3));
      rtcCommitScene(w.scene);
      asked = 0;
      RTCRayHit r = make_ray({0.25f, 0.25f, 9}, {0, 0, -1});
      intersect(w.scene, r);
      CHECK(is_hit(r) && r.ray.tfar == 8);
      if (is_ours()) CHECK(r.hit.geomID == 0 && asked == (filtered & 1) + (filtered >> 1));
    }
  }
}

// A buffer that takes another's place is looked at by the next commit that has something new, and so are flags and qualities.
void other_buffers() {
  World w(RTC_SCENE_FLAG_DYNAMIC);
  w.add(w.floor(1));
  w.add(w.floor(0));
  RTCGeometry first = rtcGetGeometry(w.scene, 0), second = rtcGetGeometry(w.scene, 1);
  auto height = [&] { return 9 - shoot(w.scene, {0.25f, 0.25f, 9}, {0, 0, -1}).ray.tfar; };
  for (int i = 0; i < 3; i++) rtcCommitGeometry(second), rtcCommitScene(w.scene);
  CHECK(near(height(), 1));
  const Vec higher[4] = {{0, 0, 5}, {1, 0, 5}, {0, 1, 5}, {0, 0, 0}};
  rtcSetSharedGeometryBuffer(first, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, higher, 0, 12, 3);
  rtcCommitGeometry(second);
  rtcCommitScene(w.scene);
  CHECK(near(height(), 5));
  for (RTCBuildQuality quality : {RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_HIGH, RTC_BUILD_QUALITY_MEDIUM})
    for (int flags : {int(RTC_SCENE_FLAG_COMPACT), int(RTC_SCENE_FLAG_DYNAMIC), int(RTC_SCENE_FLAG_DYNAMIC) | int(RTC_SCENE_FLAG_ROBUST)}) {
      rtcSetSceneFlags(w.scene, RTCSceneFlags(flags));
      rtcSetSceneBuildQuality(w.scene, quality);
      rtcCommitGeometry(second);
      rtcCommitScene(w.scene);
      CHECK(near(height(), 5));
    }
}

}  // namespace

void dynamics() {
  stacks();
  accounts();
  announcements();
  accepted_ties();
  other_buffers();
}
