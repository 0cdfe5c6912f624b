#include "navigation/aiding/camera/camera_imu.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "navigation/aiding/camera/common_tracks.h"

namespace roadfix::navigation {

namespace {

constexpr int kRounds = 12;
constexpr int kLeastPoints = 25;
constexpr double kNoise_px = 0.7;       // beyond it a distance counts less
constexpr double kStep_s = 0.005;       // of the search for the offset
constexpr double kMaxPair_s = 0.5;      // between two pictures
constexpr double kSteady = 0.05;        // rad/s: turning slower, the direction of travel is the x axis
constexpr double kDirectionStd = 0.02;  // rad, of it in one pair besides its own doubt: sideslip, pitching
constexpr double kRateStd = 0.01;       // rad/s, of a rate in one pair
constexpr int kLeastPairs = 50;
constexpr double kLeastTurning = 0.05;  // rad/s, root mean square: less tells no time

struct Match {
  Eigen::Vector3d before, now;
  double px;
};

std::vector<Match> matches_of(const SeenPicture& before, const SeenPicture& now) {
  std::vector<Match> out;
  for_each_common(before.points, now.points, [&](const SeenPoint& then, const SeenPoint& p) {
    out.push_back({then.left.z.homogeneous(), p.left.z.homogeneous(), p.left.px});
  });
  return out;
}

/// Two directions at right angles to t and to each other.
Eigen::Matrix<double, 3, 2> across(const Eigen::Vector3d& t) {
  const Eigen::Vector3d other = std::abs(t.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  Eigen::Matrix<double, 3, 2> B;
  B.col(0) = t.cross(other).normalized();
  B.col(1) = t.cross(B.col(0));
  return B;
}

struct Samples {
  std::span<const ImuSample> imu;
  std::vector<Eigen::Vector3d> angle;  ///< integral of the rate up to each sample

  explicit Samples(std::span<const ImuSample> all) : imu(all) {
    angle.reserve(all.size());
    for (size_t i = 0; i < all.size(); ++i) {
      const double dt = i == 0 ? 0.0 : seconds_between(all[i - 1].t_us, all[i].t_us);
      angle.push_back(i == 0 ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                             : Eigen::Vector3d(angle.back() + dt * all[i].gyro));
    }
  }
  [[nodiscard]] std::optional<Eigen::Vector3d> angle_at(int64_t t_us) const {
    const auto after =
        std::lower_bound(imu.begin(), imu.end(), t_us, [](const ImuSample& s, int64_t t) { return s.t_us < t; });
    if (after == imu.begin() || after == imu.end()) return std::nullopt;
    const auto i = static_cast<size_t>(after - imu.begin());
    return angle[i] - seconds_between(t_us, imu[i].t_us) * imu[i].gyro;
  }
  [[nodiscard]] std::optional<Eigen::Vector3d> mean_rate(int64_t from_us, int64_t to_us) const {
    const auto a = angle_at(from_us), b = angle_at(to_us);
    if (!a || !b) return std::nullopt;
    return Eigen::Vector3d((*b - *a) / seconds_between(from_us, to_us));
  }
};

struct Fit {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  double cost = 0.0;  ///< weighted mean square
  double rate_square = 0.0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double time_information = 0.0;
  int rates = 0;
};

/// Rotation that fits rates and directions best at this offset; rounds of reweighting keep wrong pairs out.
std::optional<Fit> fit_at(const std::vector<ViewPair>& pairs, const Samples& samples, double offset_s,
                          const Eigen::Vector3d& forward) {
  struct Rates {
    Eigen::Vector3d camera, imu;
    const ViewPair* pair;
  };
  const auto offset_us = static_cast<int64_t>(std::llround(1e6 * offset_s));
  std::vector<Rates> rates;
  for (const ViewPair& p : pairs) {
    const auto rate = samples.mean_rate(p.from_us + offset_us, p.to_us + offset_us);
    if (rate) rates.push_back({p.turn / seconds_between(p.from_us, p.to_us), *rate, &p});
  }
  if (static_cast<int>(rates.size()) < kLeastPairs) return std::nullopt;
  Fit fit;
  std::vector<double> weight(rates.size(), 1.0);
  std::vector<double> of_direction(rates.size(), 0.0);  // weights over variance
  const auto variance_of = [](const ViewPair& p) {
    return kDirectionStd * kDirectionStd + 1.0 / p.direction_certainty;
  };
  for (size_t i = 0; i < rates.size(); ++i)
    if (rates[i].camera.norm() < kSteady && rates[i].pair->direction_certainty > 0.0)
      of_direction[i] = 1.0 / variance_of(*rates[i].pair);
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  for (int round = 0; round < 6; ++round) {
    Eigen::Vector3d mean_camera = Eigen::Vector3d::Zero(), mean_imu = Eigen::Vector3d::Zero();
    double sum = 0.0;
    for (size_t i = 0; i < rates.size(); ++i) {
      mean_camera += weight[i] * rates[i].camera;
      mean_imu += weight[i] * rates[i].imu;
      sum += weight[i];
    }
    mean_camera /= sum;
    mean_imu /= sum;
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();  // of Wahba's problem: sum w imu camera'
    for (size_t i = 0; i < rates.size(); ++i) {
      M += weight[i] / (kRateStd * kRateStd) * (rates[i].imu - mean_imu) * (rates[i].camera - mean_camera).transpose();
      M += of_direction[i] * forward * rates[i].pair->direction.transpose();
    }
    const Eigen::Matrix3d R = wahba_rotation(M);
    fit.q = Eigen::Quaterniond(R).normalized();
    bias = mean_imu - R * mean_camera;
    for (size_t i = 0; i < rates.size(); ++i) {
      const double e = (rates[i].imu - R * rates[i].camera - bias).norm() / (2.0 * kRateStd);
      weight[i] = 1.0 / (1.0 + e * e);
      if (of_direction[i] == 0.0) continue;
      const double variance = variance_of(*rates[i].pair);
      of_direction[i] = 1.0 / (variance + 0.25 * (R * rates[i].pair->direction - forward).squaredNorm());
    }
  }
  double sum = 0.0;
  const Eigen::Matrix3d R = fit.q.toRotationMatrix();
  for (size_t i = 0; i < rates.size(); ++i) {
    const double e = (rates[i].imu - R * rates[i].camera - bias).squaredNorm();
    fit.cost += std::log1p(e / (4.0 * kRateStd * kRateStd));  // Cauchy's: what the weights stand for
    fit.rate_square += weight[i] * e;
    sum += weight[i];
    const Eigen::Matrix3d S = skew(R * rates[i].camera);
    fit.information += weight[i] / (kRateStd * kRateStd) * S.transpose() * S;
    const Eigen::Matrix3d D = skew(forward);
    fit.information += of_direction[i] * D.transpose() * D;
  }
  for (size_t i = 1; i + 1 < rates.size(); ++i) {
    const double dt = seconds_between(rates[i - 1].pair->from_us, rates[i + 1].pair->from_us);
    fit.time_information += weight[i] * ((rates[i + 1].imu - rates[i - 1].imu) / dt).squaredNorm();
  }
  fit.cost /= static_cast<double>(rates.size());
  fit.rate_square /= sum;
  fit.time_information /= fit.rate_square / 3.0;
  fit.rates = static_cast<int>(rates.size());
  return fit;
}

}  // namespace

std::optional<ViewPair> view_pair(const SeenPicture& before, const SeenPicture& now) {
  const std::vector<Match> matches = matches_of(before, now);
  if (static_cast<int>(matches.size()) < kLeastPoints) return std::nullopt;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  // now to before
  Eigen::Vector3d t = Eigen::Vector3d::UnitZ();           // of now in before
  Eigen::Matrix<double, 5, 5> A;
  double by_noise = 0.0;  // what A tells of t where nothing travels and the points only tremble
  for (int round = 0; round < kRounds; ++round) {
    A.setZero();
    by_noise = 0.0;
    Eigen::Matrix<double, 5, 1> g = Eigen::Matrix<double, 5, 1>::Zero();
    const Eigen::Matrix3d R = q.toRotationMatrix();
    const Eigen::Matrix<double, 3, 2> B = across(t);
    const double gate = round < 4 ? 4.0 * kNoise_px : kNoise_px;
    for (const Match& m : matches) {
      // e = before . (t x R now), over its length by the first point: a distance from the epipolar line.
      const Eigen::Vector3d ray = R * m.now;
      const Eigen::Vector3d line = t.cross(ray);
      const double scale = m.px / std::max(1e-9, line.head<2>().norm());
      const double e = scale * m.before.dot(line);
      Eigen::Matrix<double, 1, 5> J;
      J.head<3>() = scale * m.before.cross(t).transpose() * (-R * skew(m.now));
      J.tail<2>() = scale * ray.cross(m.before).transpose() * B;
      const double w = 1.0 / (1.0 + e * e / (gate * gate));
      A += w * J.transpose() * J;
      by_noise += w * 2.0 * (scale / m.px) * (scale / m.px) * kNoise_px * kNoise_px;
      g -= w * e * J.transpose();
    }
    A.diagonal().array() += 1e-6;
    A(3, 3) += 1.0;  // without travel any direction fits: it stays
    A(4, 4) += 1.0;
    const Eigen::Matrix<double, 5, 1> d = A.ldlt().solve(g);
    q = (q * exp_q(d.head<3>())).normalized();
    t = (t + B * d.tail<2>()).normalized();
    if (d.norm() < 1e-7) break;
  }
  ViewPair pair;
  pair.from_us = before.t_us;
  pair.to_us = now.t_us;
  pair.turn = log_q(q);
  pair.direction = t;
  // What is known of the direction once the turn is unknown as well.
  const Eigen::Matrix2d left = A.bottomRightCorner<2, 2>() - A.bottomLeftCorner<2, 3>() *
                                                                 A.topLeftCorner<3, 3>().inverse() *
                                                                 A.topRightCorner<3, 2>();
  const double smallest = left.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() - 1.0 - by_noise;
  pair.direction_certainty = std::max(0.0, smallest) / (kNoise_px * kNoise_px);
  pair.points = static_cast<int>(matches.size());
  return pair;
}

Eigen::Matrix3d wahba_rotation(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  return U * svd.matrixV().transpose();
}

std::optional<CameraImuCalibration> calibrate_camera_imu(std::span<const SeenPicture> frames,
                                                         std::span<const ImuSample> imu, double largest_offset,
                                                         const Eigen::Matrix3d& R_imu_vehicle) {
  std::vector<ViewPair> pairs;
  for (size_t i = 1; i < frames.size(); ++i) {
    if (seconds_between(frames[i - 1].t_us, frames[i].t_us) > kMaxPair_s) continue;
    if (const auto pair = view_pair(frames[i - 1], frames[i])) pairs.push_back(*pair);
  }
  const Samples samples(imu);
  const Eigen::Vector3d forward = R_imu_vehicle.col(0);
  const int steps = static_cast<int>(std::ceil(largest_offset / kStep_s));
  std::vector<std::optional<Fit>> fits;
  int best = -1;
  for (int k = -steps; k <= steps; ++k) {
    fits.push_back(fit_at(pairs, samples, kStep_s * k, forward));
    const auto& fit = fits.back();
    if (fit && (best < 0 || fit->cost < fits[static_cast<size_t>(best)]->cost))
      best = static_cast<int>(fits.size()) - 1;
  }
  if (best < 0) return std::nullopt;
  const Fit& fit = *fits[static_cast<size_t>(best)];
  CameraImuCalibration out;
  out.q_imu_camera = fit.q;
  out.pairs = fit.rates;
  out.residual = std::sqrt(fit.rate_square);
  out.time_offset = kStep_s * (best - steps);
  if (best > 0 && best + 1 < static_cast<int>(fits.size()) && fits[static_cast<size_t>(best) - 1] &&
      fits[static_cast<size_t>(best) + 1]) {
    const double low = fits[static_cast<size_t>(best) - 1]->cost, high = fits[static_cast<size_t>(best) + 1]->cost;
    const double bend = low - 2.0 * fit.cost + high;
    if (bend > 0.0) out.time_offset += 0.5 * kStep_s * (low - high) / bend;
  }
  const Eigen::Matrix3d covariance = fit.information.inverse();
  out.turn_std = std::sqrt(covariance.diagonal().maxCoeff());
  out.time_offset_std = fit.time_information > 0.0 ? 1.0 / std::sqrt(fit.time_information) : largest_offset;
  double square = 0.0;
  for (const ViewPair& p : pairs) square += (p.turn / seconds_between(p.from_us, p.to_us)).squaredNorm();
  if (std::sqrt(square / static_cast<double>(pairs.size())) < kLeastTurning || !std::isfinite(out.turn_std))
    return std::nullopt;
  return out;
}

}  // namespace roadfix::navigation
