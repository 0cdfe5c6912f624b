#include "features/perspective_bend.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "features/patch.h"

namespace roadfix {
namespace {

const CameraIntrinsics kPinhole{640, 192, 370.0, 370.0, 320.0, 96.0, Distortion::kNone, {}};
const CameraIntrinsics kLens{640, 192, 370.0, 370.0, 320.0, 96.0, Distortion::kRadTan, {-0.28, 0.09, 4e-4, -3e-4, 0.0}};
const Eigen::Vector3d kForward = Eigen::Vector3d::UnitZ();
constexpr int kWindow = 11;

/// A plane normal . p = 1 seen again after `travel`, camera axes, without a rotation.
struct Plane {
  Camera camera;
  Eigen::Vector3d normal, travel;

  [[nodiscard]] Eigen::Vector3d point(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d ray = camera.unproject(pixel)->homogeneous();
    return ray / normal.dot(ray);
  }
  [[nodiscard]] Eigen::Vector2d seen_again(const Eigen::Vector2d& pixel) const {
    return *camera.project(point(pixel) - travel);
  }
  [[nodiscard]] Eigen::Matrix2d shape(const Eigen::Vector2d& pixel) const {
    Eigen::Matrix2d A;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d step = 1e-3 * Eigen::Vector2d::Unit(k);
      A.col(k) = (seen_again(pixel + step) - seen_again(pixel - step)) / 2e-3;
    }
    return A;
  }
  /// What the affine shape leaves, in the template's pixels, of a point `x` from the centre.
  [[nodiscard]] Eigen::Vector2d left(const Eigen::Vector2d& pixel, const Eigen::Vector2d& x) const {
    return shape(pixel).inverse() * (seen_again(pixel + x) - seen_again(pixel)) - x;
  }
};

const Eigen::Vector3d kRightWall(1.0 / 3.7, 0.0, 0.0), kLeftWall(-1.0 / 6.6, 0.0, 0.0), kRoad(0.0, 1.0 / 1.55, 0.0);

Eigen::Vector2d bent(const PatchBend& bend, const Eigen::Vector2d& x) {
  return bend.cast<double>() * Eigen::Vector3d(x.x() * x.x(), x.x() * x.y(), x.y() * x.y());
}

TEST_CASE("the second order of a plane follows from its shape and the direction of travel") {
  for (const CameraIntrinsics& lens : {kPinhole, kLens}) {
    for (const Eigen::Vector3d& travel :
         {Eigen::Vector3d(0.0, 0.0, 1.4), Eigen::Vector3d(0.15, 0.02, 1.2), Eigen::Vector3d(0.0, 0.0, -0.9)}) {
      const auto check = [&](const Eigen::Vector3d& normal, double u, double v) {
        const Plane plane{Camera(lens), normal, travel};
        const Eigen::Vector2d pixel(u, v);
        const auto error = [&](const Eigen::Vector3d& direction) {
          const PatchBend bend =
              PerspectiveBend(plane.camera, direction).of(pixel, plane.seen_again(pixel), plane.shape(pixel));
          double off = 0.0, size = 0.0;
          for (const Eigen::Vector2d& x : {Eigen::Vector2d(5, 0), Eigen::Vector2d(0, 5), Eigen::Vector2d(-4, 4),
                                           Eigen::Vector2d(-5, 0), Eigen::Vector2d(0, -5)}) {
            off += (bent(bend, x) - plane.left(pixel, x)).norm();
            size += plane.left(pixel, x).norm();
          }
          return off / size;
        };
        CAPTURE(normal.transpose(), travel.transpose(), u, v);
        CHECK(error(travel) < 0.15);                   // third order
        CHECK(error(Eigen::Vector3d::UnitX()) > 0.3);  // teeth
      };
      check(kRightWall, 470.0, 60.0);
      check(kRightWall, 540.0, 120.0);
      check(kLeftWall, 120.0, 80.0);
      check(kRoad, 330.0, 150.0);
    }
  }
}

TEST_CASE("nothing bends that the motion does not slant") {
  const PerspectiveBend bend(Camera(kPinhole), kForward);
  const Eigen::Vector2d pixel(450.0, 100.0);
  CHECK(bend.of(pixel, pixel, Eigen::Matrix2d::Identity()).norm() < 1e-9F);
  const Plane facing{Camera(kPinhole), {0.0, 0.0, 0.1}, {0.0, 0.0, 1.0}};
  CHECK(bend.of(pixel, facing.seen_again(pixel), facing.shape(pixel)).norm() < 1e-7F);
  // A shape that is none, or pixels without a ray.
  CHECK(bend.of(pixel, pixel, -Eigen::Matrix2d::Identity()).norm() == 0.0F);
  CHECK(bend.of({std::nan(""), 0.0}, pixel, Eigen::Matrix2d::Identity()).norm() == 0.0F);
}

/// Waves of half a metre to two on the plane, which no pixel is too coarse for.
class Wall {
 public:
  explicit Wall(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    for (Eigen::Vector3d& w : waves_) {
      const double length = 0.5 * std::pow(4.0, unit(random)), angle = M_PI * unit(random);
      w = {2.0 * M_PI / length * std::cos(angle), 2.0 * M_PI / length * std::sin(angle), 2.0 * M_PI * unit(random)};
    }
  }
  [[nodiscard]] cv::Mat image(const Plane& plane, const Eigen::Vector3d& eye) const {
    cv::Mat out(192, 640, CV_8UC1, cv::Scalar(128));
    for (int v = 0; v < out.rows; ++v) {
      for (int u = 420; u < out.cols; ++u) {
        const Eigen::Vector3d ray = plane.camera.unproject({u, v})->homogeneous();
        const Eigen::Vector3d p = eye + ray * ((1.0 - plane.normal.dot(eye)) / plane.normal.dot(ray));
        double sum = 0.0;
        for (const Eigen::Vector3d& w : waves_) sum += std::cos(w.x() * p.z() + w.y() * p.y() + w.z());
        out.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>(128.0 + 25.0 * sum);
      }
    }
    return out;
  }

 private:
  std::array<Eigen::Vector3d, 16> waves_;
};

TEST_CASE("patches of a wall are pulled outwards, and its second order is what pulls them") {
  const Plane wall{Camera(kPinhole), kRightWall, {0.0, 0.0, 1.4}};
  const PerspectiveBend bend(wall.camera, kForward);
  double pulled = 0.0, left = 0.0;
  int count = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    const Wall painted(seed);
    const cv::Mat first = painted.image(wall, Eigen::Vector3d::Zero()), second = painted.image(wall, wall.travel);
    for (int v = 20; v < 180; v += 12) {
      for (int u = 440; u < 560; u += 12) {
        const Eigen::Vector2d pixel(u, v), truth = wall.seen_again(pixel);
        const auto patch = extract_patch(first, pixel.cast<float>(), kWindow);
        if (!patch) continue;
        PatchAlignment start;
        start.centre = truth.cast<float>();
        start.shape = wall.shape(pixel).cast<float>();
        PatchModel<6> model;
        const auto found = align_patch(*patch, model, second, start, {kWindow, 0.9, 0.1});
        if (!found) continue;
        const double pull = static_cast<double>(found->point(*patch).x()) - truth.x();
        if (std::abs(pull) > 0.5) continue;
        const PatchBend second_order = bend.of(pixel, found->point(*patch).cast<double>(), found->shape.cast<double>());
        pulled += pull;
        left += pull - static_cast<double>((found->shape * model.shift(second_order)).x());
        ++count;
      }
    }
  }
  REQUIRE(count > 200);
  CAPTURE(count, pulled / count, left / count);
  CHECK(pulled / count > 0.006);
  CHECK(std::abs(left) < 0.25 * pulled);
}

}  // namespace
}  // namespace roadfix
