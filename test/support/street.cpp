#include "support/street.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "support/pictures.h"

namespace roadfix::test {
namespace {

constexpr int kTexture = 1024;            ///< px, repeats
constexpr double kTexelsPerMetre = 24.0;  ///< of the finest level

/// Bilinear sample of a repeating texture.
double sample(const cv::Mat& level, double u, double v) {
  const double fu = std::floor(u), fv = std::floor(v);
  const int mask_u = level.cols - 1, mask_v = level.rows - 1;
  const int u0 = static_cast<int>(fu) & mask_u, v0 = static_cast<int>(fv) & mask_v;
  const int u1 = (u0 + 1) & mask_u, v1 = (v0 + 1) & mask_v;
  const double a = u - fu, b = v - fv;
  const uint8_t* top = level.ptr<uint8_t>(v0);
  const uint8_t* bottom = level.ptr<uint8_t>(v1);
  return (1 - b) * ((1 - a) * top[u0] + a * top[u1]) + b * ((1 - a) * bottom[u0] + a * bottom[u1]);
}

}  // namespace

Street::Street(unsigned seed) {
  levels_.push_back(texture(kTexture, kTexture, seed, 8));
  while (levels_.back().cols > 4) {
    cv::Mat half;
    cv::resize(levels_.back(), half, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
    levels_.push_back(half);
  }
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  planes_ = {{{0.0, 1.6, 0.0}, x, z},  {{-7.0, 0.0, 0.3}, z, y},  {{8.0, 0.0, 0.7}, z, y},
             {{0.0, 0.0, 90.0}, x, y}, {{0.0, 0.0, -90.0}, x, y}, {{0.0, -9.0, 0.0}, z, x}};
}

cv::Mat Street::image(const SE3& T_world_camera, const CameraIntrinsics& lens, double noise,
                      unsigned noise_seed) const {
  cv::Mat out(lens.height, lens.width, CV_8UC1);
  std::mt19937 random(noise_seed);
  std::normal_distribution<double> grain(0.0, noise);
  const Eigen::Matrix3d R = T_world_camera.R();
  for (int row = 0; row < lens.height; ++row) {
    for (int column = 0; column < lens.width; ++column) {
      const Eigen::Vector3d ray = R * Eigen::Vector3d((column - lens.cx) / lens.fx, (row - lens.cy) / lens.fy, 1.0);
      double nearest = 1e9, u = 0.0, v = 0.0;
      for (const Plane& plane : planes_) {
        const Eigen::Vector3d normal = plane.along_u.cross(plane.along_v);
        const double distance = normal.dot(plane.point - T_world_camera.p) / normal.dot(ray);
        if (!(distance > 0.05 && distance < nearest)) continue;
        nearest = distance;
        const Eigen::Vector3d hit = T_world_camera.p + distance * ray - plane.point;
        u = hit.dot(plane.along_u) * kTexelsPerMetre;
        v = hit.dot(plane.along_v) * kTexelsPerMetre;
      }
      const double texels_per_pixel = nearest / lens.fx * kTexelsPerMetre;
      const auto level = static_cast<size_t>(std::clamp(std::lround(std::log2(std::max(1.0, texels_per_pixel))), 0L,
                                                        static_cast<long>(levels_.size()) - 1));
      const double shrink = 1.0 / static_cast<double>(1U << level);
      // A coarse texel's centre is the mean of those it was made of: without the halves every change of level would
      // shift the texture by up to half a pixel.
      const double value = sample(levels_[level], (u + 0.5) * shrink - 0.5, (v + 0.5) * shrink - 0.5) + grain(random);
      out.at<uint8_t>(row, column) = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    }
  }
  return out;
}

}  // namespace roadfix::test
