/// The scene's rays against Mesa's software rasteriser on the same faces and camera: depth only, no texture, no
/// shadow, no distortion (which a rasteriser would have to resample). Prints milliseconds a picture of each, one
/// thread, and the share of pixels on which their depths agree. Built where libosmesa6-dev is installed.
///   LP_NUM_THREADS=0 mesa_compare
#include <GL/osmesa.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "program.h"
#include "simulation/scenarios.h"
#include "simulation/scene/drive_scene.h"

namespace roadfix {
namespace {

constexpr float kNear_m = 0.3F;
constexpr float kFar_m = 900.0F;
constexpr int kPictures = 40;

using bench::cpu_ms;

/// Pinhole of the camera as OpenGL's clip space, rows from the bottom up.
Eigen::Matrix4f projection(const CameraIntrinsics& c) {
  Eigen::Matrix4d P = Eigen::Matrix4d::Zero();
  P(0, 0) = 2.0 * c.fx / c.width;
  P(0, 2) = (2.0 * c.cx + 1.0) / c.width - 1.0;
  P(1, 1) = -2.0 * c.fy / c.height;
  P(1, 2) = 1.0 - (2.0 * c.cy + 1.0) / c.height;
  P(2, 2) = (kFar_m + kNear_m) / (kFar_m - kNear_m);
  P(2, 3) = -2.0 * kFar_m * kNear_m / (kFar_m - kNear_m);
  P(3, 2) = 1.0;
  return P.cast<float>();
}

class Rasteriser {
 public:
  Rasteriser(const World& world, const CameraIntrinsics& lens) : lens_(lens), colour_(pixels() * 4), depth_(pixels()) {
    context_ = OSMesaCreateContextExt(OSMESA_RGBA, 32, 0, 0, nullptr);
    if (context_ == nullptr ||
        OSMesaMakeCurrent(context_, colour_.data(), GL_UNSIGNED_BYTE, lens.width, lens.height) == GL_FALSE)
      throw std::runtime_error("mesa_compare: no off-screen context");
    for (const Face& f : world.faces) {
      for (const std::size_t k : {0U, 1U, 3U, 1U, 2U, 3U}) {  // the halves of a face
        for (int i = 0; i < 3; ++i) vertices_.push_back(static_cast<float>(f.corner[k][i]));
        shades_.insert(shades_.end(), 3, f.light[k]);
      }
    }
    glEnable(GL_DEPTH_TEST);
    glEnableClientState(GL_VERTEX_ARRAY);
    glEnableClientState(GL_COLOR_ARRAY);
    glVertexPointer(3, GL_FLOAT, 0, vertices_.data());
    glColorPointer(3, GL_FLOAT, 0, shades_.data());
  }
  ~Rasteriser() { OSMesaDestroyContext(context_); }
  Rasteriser(const Rasteriser&) = delete;
  Rasteriser& operator=(const Rasteriser&) = delete;

  /// Depths in m, rows from the top.
  std::vector<float> draw(const View& view) {
    const SE3 T = view.T_enu_camera.inverse();
    Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
    M.topLeftCorner<3, 3>() = T.R();
    M.topRightCorner<3, 1>() = T.p;
    const Eigen::Matrix4f P = projection(lens_);
    const Eigen::Matrix4f V = M.cast<float>();
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glMatrixMode(GL_PROJECTION);
    glLoadMatrixf(P.data());
    glMatrixMode(GL_MODELVIEW);
    glLoadMatrixf(V.data());
    glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(vertices_.size() / 3));
    glFinish();
    glReadPixels(0, 0, lens_.width, lens_.height, GL_DEPTH_COMPONENT, GL_FLOAT, depth_.data());
    std::vector<float> out(pixels());
    for (std::size_t v = 0; v < static_cast<std::size_t>(lens_.height); ++v) {
      for (std::size_t u = 0; u < static_cast<std::size_t>(lens_.width); ++u) {
        const std::size_t width = static_cast<std::size_t>(lens_.width);
        const float z = depth_[(static_cast<std::size_t>(lens_.height) - 1 - v) * width + u];
        out[v * width + u] =
            z >= 1.0F ? std::numeric_limits<float>::infinity()
                      : 2.0F * kFar_m * kNear_m / (kFar_m + kNear_m - (2.0F * z - 1.0F) * (kFar_m - kNear_m));
      }
    }
    return out;
  }

 private:
  [[nodiscard]] std::size_t pixels() const { return static_cast<std::size_t>(lens_.width * lens_.height); }

  CameraIntrinsics lens_;
  OSMesaContext context_ = nullptr;
  std::vector<std::uint8_t> colour_;
  std::vector<float> depth_, vertices_, shades_;
};

std::vector<float> cast(RayScene& scene, const CameraIntrinsics& lens, const View& view) {
  const RayWindow& window = scene.prepare(view.T_enu_camera.p, view.t_s, RayUse::kPoints);
  const Eigen::Vector3d eye = view.T_enu_camera.p - window.origin();
  std::vector<float> out;
  for (int v = 0; v < lens.height; ++v) {
    for (int u = 0; u < lens.width; ++u) {
      const Eigen::Vector3d direction((u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0);
      const RayHit hit = window.nearest(eye, view.T_enu_camera.q * direction);
      out.push_back(hit.triangle < 0 ? std::numeric_limits<float>::infinity() : static_cast<float>(hit.distance));
    }
  }
  return out;
}

void compare(const char* name) {
  ScenarioConfig config = scenario(name);
  config.camera.layout = CameraLayout::kMono;
  config.scene.moving_cars = false;
  const SimulatedDrive drive = simulate(config, 1);
  const SimulatedRig rig = rig_of(drive);
  const CameraIntrinsics& lens = rig.camera.intrinsics();
  const World world = world_of(drive);
  Rasteriser mesa(world, lens);
  RayScene rays(world);
  double mesa_ms = 0.0;
  double rays_ms = 0.0;
  std::size_t agree = 0;
  std::size_t all = 0;
  for (int k = -1; k < kPictures; ++k) {  // the first one makes the tree and Mesa's code
    const View view = view_at(drive, rig.T_vehicle_left, drive.exposures[static_cast<std::size_t>(201 + k)]);
    const double begin = cpu_ms();
    const auto a = mesa.draw(view);
    const double middle = cpu_ms();
    const auto b = cast(rays, lens, view);
    if (k < 0) continue;
    mesa_ms += (middle - begin) / kPictures;
    rays_ms += (cpu_ms() - middle) / kPictures;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const bool same_sky = !(a[i] < 400.0F) && !(b[i] < 400.0F);
      agree += same_sky || std::abs(a[i] - b[i]) < 0.01F * b[i] ? 1U : 0U;
    }
    all += a.size();
  }
  std::printf("%-12s %6zu faces  mesa %6.1f ms  rays %6.1f ms  depths agree on %.2f %%\n", name, world.faces.size(),
              mesa_ms, rays_ms, 100.0 * static_cast<double>(agree) / static_cast<double>(all));
}

}  // namespace
}  // namespace roadfix

int main() {
  for (const char* name : {"city_loop", "highway", "tunnel_lit"}) roadfix::compare(name);
  return 0;
}
