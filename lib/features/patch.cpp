#include "features/patch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace roadfix {
namespace {

constexpr int kLanes = 8;  ///< parallel partial sums: a fixed order that fits vector registers
constexpr int kMaxPixels = (kMaxPatchWindow * kMaxPatchWindow + kLanes - 1) / kLanes * kLanes;
constexpr int kMaxIterations = 20;
constexpr float kConvergencePx = 0.02F;                        ///< converged when no pixel of the patch moves by more
constexpr float kMinStepFactor = 0.5F, kMaxStepFactor = 1.5F;  ///< limits of the step factor, see StepScaling
constexpr int kEarlyExitIterations = 3;         ///< iterations after which a correct patch is nearly aligned
constexpr float kEarlyExitCorrelation = 0.75F;  ///< of the required correlation, for early rejection
constexpr float kIntensityNoise = 3.0F;         ///< grey levels: sensor noise and interpolation
constexpr float kMaxPositionStd_px = 0.3F;      ///< position sigma from this noise; above it the patch has too
                                                ///< little texture
constexpr float kMinGain = 0.1F, kMaxGain = 10.0F;

using Pixels = std::array<float, kMaxPixels>;
using Lanes = Eigen::Array<float, kLanes, 1>;
template <int N>
using Vector = Eigen::Matrix<float, N, 1>;
template <int N>
using Square = Eigen::Matrix<float, N, N>;

Eigen::Map<const Lanes> lanes(const float* pixels) { return Eigen::Map<const Lanes>(pixels); }

float total(const Lanes& x) { return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7])); }

float dot(const float* a, const float* b, int n) {
  Lanes sum = Lanes::Zero();
  for (int i = 0; i < n; i += kLanes) sum += lanes(a + i) * lanes(b + i);
  return total(sum);
}

float sum_of(const float* a, int n) {
  Lanes sum = Lanes::Zero();
  for (int i = 0; i < n; i += kLanes) sum += lanes(a + i);
  return total(sum);
}

int padded(int count) { return (count + kLanes - 1) / kLanes * kLanes; }

void centre(float* pixels, int count) {
  const float mean = sum_of(pixels, padded(count)) / static_cast<float>(count);
  for (int i = 0; i < count; ++i) pixels[i] -= mean;
}

/// Intensities and their derivatives by position (and shape, in pixels at the patch's edge). Padding is zero.
template <int N>
void read_pixels(const Patch& patch, int side, PatchModel<N>& m) {
  const ptrdiff_t n = padded(m.count), stride = side + 2;
  const int half = side / 2;
  m.pixels.assign(static_cast<size_t>((N + 1) * n), 0.0F);
  const float edge = 1.0F / static_cast<float>(std::max(1, half));
  float* out = m.pixels.data();
  for (int row = 0; row < side; ++row) {
    const uint8_t* line = patch.grey.data() + (row + 1) * stride + 1;
    const float y = static_cast<float>(row - half) * edge;
    for (int column = 0; column < side; ++column, ++out) {
      const float x = static_cast<float>(column - half) * edge;
      const float gx = 0.5F * static_cast<float>(line[column + 1] - line[column - 1]);
      const float gy = 0.5F * static_cast<float>(line[column + stride] - line[column - stride]);
      out[0] = static_cast<float>(line[column]);
      out[n] = gx;
      out[2 * n] = gy;
      if constexpr (N == 6) {
        out[3 * n] = gx * x;
        out[4 * n] = gx * y;
        out[5 * n] = gy * x;
        out[6 * n] = gy * y;
      }
    }
  }
}

/// The least-squares translation that stands for each element of a bend: the row of the estimator for u and v, times
/// the change of intensity that the element makes.
template <int N>
void respond_to_bend(const Patch& patch, int side, PatchModel<N>& m) {
  const ptrdiff_t n = padded(m.count), stride = side + 2;
  const int half = side / 2;
  Pixels row_u{}, row_v{};
  for (int k = 0; k < N; ++k) {
    const float* slope = m.pixels.data() + (k + 1) * n;
    for (ptrdiff_t i = 0; i < n; i += kLanes) {
      Eigen::Map<Lanes>(row_u.data() + i) += m.inverse(0, k) * lanes(slope + i);
      Eigen::Map<Lanes>(row_v.data() + i) += m.inverse(1, k) * lanes(slope + i);
    }
  }
  size_t i = 0;
  for (int row = 0; row < side; ++row) {
    const uint8_t* line = patch.grey.data() + (row + 1) * stride + 1;
    for (int column = 0; column < side; ++column, ++i) {
      const auto x = static_cast<float>(column - half), y = static_cast<float>(row - half);
      const Eigen::Vector2f slope(0.5F * static_cast<float>(line[column + 1] - line[column - 1]),
                                  0.5F * static_cast<float>(line[column + stride] - line[column - stride]));
      const Eigen::Matrix<float, 1, 6> change = (Eigen::Matrix<float, 1, 6>() << x * x * slope.transpose(),
                                                 x * y * slope.transpose(), y * y * slope.transpose())
                                                    .finished();
      m.per_bend += Eigen::Vector2f(row_u[i], row_v[i]) * change;
    }
  }
}

/// Removes mean and intensity pattern from the derivatives. False where the texture is too weak.
template <int N>
bool prepare(const Patch& patch, int side, float prior, PatchModel<N>& m) {
  m.count = side * side;
  read_pixels(patch, side, m);
  const int n = padded(m.count);
  float* value = m.pixels.data();
  const auto slope = [value, n](int k) { return value + static_cast<ptrdiff_t>(k + 1) * n; };
  centre(value, m.count);
  m.energy = dot(value, value, n);
  if (!(m.energy > 0.0F)) return false;
  for (int a = 0; a < N; ++a) {
    centre(slope(a), m.count);
    const float share = dot(slope(a), value, n) / m.energy;
    for (int k = 0; k < n; k += kLanes) Eigen::Map<Lanes>(slope(a) + k) -= share * lanes(value + k);
  }
  Square<N> H;
  for (int a = 0; a < N; ++a) {
    for (int b = 0; b <= a; ++b) H(a, b) = H(b, a) = dot(slope(a), slope(b), n);
    if (a >= 2) H(a, a) += prior;
  }
  const Eigen::LDLT<Square<N>> factors(H);
  m.inverse = factors.solve(Square<N>::Identity());
  if constexpr (N == 6) respond_to_bend(patch, side, m);
  const float widest = m.inverse.template topLeftCorner<2, 2>().trace();  // upper bound of the larger eigenvalue
  return factors.info() == Eigen::Success && widest >= 0.0F &&
         kIntensityNoise * kIntensityNoise * widest < kMaxPositionStd_px * kMaxPositionStd_px;
}

/// Offsets of the patch's pixels from its centre.
struct Grid {
  explicit Grid(int side) : count(static_cast<size_t>(side) * static_cast<size_t>(side)) {
    const int half = side / 2;
    size_t i = 0;
    for (int row = -half; row <= half; ++row) {
      for (int column = -half; column <= half; ++column, ++i) {
        x[i] = static_cast<float>(column);
        y[i] = static_cast<float>(row);
      }
    }
  }
  size_t count;
  Pixels x, y;
};

/// Intensities at the aligned pixels; false where one lies outside the image. In three passes, so that all but the
/// loads run in vector registers.
bool sample(const cv::Mat& gray, const PatchAlignment& at, int side, const Grid& grid, Pixels& out) {
  constexpr float kEdge = 0.01F;  // px, for rounding
  const int half = side / 2;
  const Eigen::Vector2f reach = at.shape.cwiseAbs().rowwise().sum() * static_cast<float>(half);
  const Eigen::Vector2f low = at.centre - reach, high = at.centre + reach;
  if (!(low.x() >= kEdge && low.y() >= kEdge && high.x() < static_cast<float>(gray.cols - 1) - kEdge &&
        high.y() < static_cast<float>(gray.rows - 1) - kEdge)) {
    return false;
  }
  std::array<int32_t, kMaxPixels> where;
  Pixels a, b;
  std::array<uint16_t, kMaxPixels> upper, lower;  // two neighbours, the left one in the low byte (x86-64, ARM64)
  const float u0 = at.centre.x(), uu = at.shape(0, 0), uv = at.shape(0, 1);
  const float v0 = at.centre.y(), vu = at.shape(1, 0), vv = at.shape(1, 1);
  const auto step = static_cast<int32_t>(gray.step[0]);
  for (size_t k = 0; k < grid.count; ++k) {
    const float u = u0 + uu * grid.x[k] + uv * grid.y[k], v = v0 + vu * grid.x[k] + vv * grid.y[k];
    const auto column = static_cast<int32_t>(u), row = static_cast<int32_t>(v);
    a[k] = u - static_cast<float>(column);
    b[k] = v - static_cast<float>(row);
    where[k] = row * step + column;
  }
  const uint8_t* first = gray.data;
  for (size_t k = 0; k < grid.count; ++k) {
    std::memcpy(&upper[k], first + where[k], 2);
    std::memcpy(&lower[k], first + where[k] + step, 2);
  }
  for (size_t k = 0; k < grid.count; ++k) {
    const auto p0 = static_cast<float>(upper[k] & 0xFF), p1 = static_cast<float>(upper[k] >> 8);
    const auto q0 = static_cast<float>(lower[k] & 0xFF), q1 = static_cast<float>(lower[k] >> 8);
    const float above = p0 + a[k] * (p1 - p0), below = q0 + a[k] * (q1 - q0);
    out[k] = above + b[k] * (below - above);
  }
  return true;
}

/// Steps with a fixed matrix are consistently too long or too short (central differences underestimate fine texture, a
/// blurred image has less): the remainder of the last step gives the factor (Aitken's extrapolation).
template <int N>
class StepScaling {
 public:
  Vector<N> of(const Vector<N>& step) {
    const float reduction = (last_step_ - step).dot(last_scaled_step_);
    const float factor = reduction > 0.0F
                             ? std::clamp(last_scaled_step_.squaredNorm() / reduction, kMinStepFactor, kMaxStepFactor)
                             : 1.0F;
    last_step_ = step;
    last_scaled_step_ = factor * step;
    return last_scaled_step_;
  }

 private:
  Vector<N> last_step_ = Vector<N>::Zero(), last_scaled_step_ = Vector<N>::Zero();
};

template <int N>
std::optional<PatchAlignment> align(const Patch& patch, PatchModel<N>& m, const cv::Mat& gray,
                                    const PatchAlignment& start, const PatchConfig& config) {
  const int side = config.window_px, half_px = side / 2;
  const auto half = static_cast<float>(half_px);
  const float reach = config.max_displacement_px > 0.0F ? config.max_displacement_px : 2.0F * half;
  const float edge_std = half * static_cast<float>(config.shape_std);
  const float prior = N == 6 ? kIntensityNoise * kIntensityNoise / (edge_std * edge_std) : 0.0F;
  if (m.count == 0) m.flat = !prepare(patch, side, prior, m);
  if (m.flat) return std::nullopt;
  const int n = padded(m.count);
  const float* value = m.pixels.data();
  const Grid grid(side);
  const Eigen::Matrix2f start_inverse = start.shape.inverse();
  const auto min_correlation = static_cast<float>(config.min_correlation);
  PatchAlignment now = start;
  StepScaling<N> step_scaling;
  Pixels pixels;
  const float* seen = pixels.data();
  std::fill(pixels.begin() + m.count, pixels.begin() + n, 0.0F);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (!sample(gray, now, side, grid, pixels)) return std::nullopt;
    const float mean = sum_of(seen, n) / static_cast<float>(m.count);
    const float spread = dot(seen, seen, n) - mean * mean * static_cast<float>(m.count);
    const float gain = std::sqrt(spread / m.energy);  // also before the patches match
    if (!(gain > kMinGain && gain < kMaxGain)) return std::nullopt;
    now.correlation = dot(value, seen, n) / (gain * m.energy);
    if (iteration >= kEarlyExitIterations && now.correlation < kEarlyExitCorrelation * min_correlation)
      return std::nullopt;
    Vector<N> b;
    for (int k = 0; k < N; ++k) b[k] = dot(value + static_cast<ptrdiff_t>(k + 1) * n, seen, n) / gain;
    if constexpr (N == 6) {
      const Eigen::Matrix2f off = start_inverse * now.shape - Eigen::Matrix2f::Identity();
      b.template tail<4>() += prior * half * Vector<4>(off(0, 0), off(0, 1), off(1, 0), off(1, 1));
    }
    const Vector<N> step = step_scaling.of(m.inverse * b);
    Eigen::Matrix2f change = Eigen::Matrix2f::Identity();
    if constexpr (N == 6) {
      change += (Eigen::Matrix2f() << step[2], step[3], step[4], step[5]).finished() / half;
      now.shape = now.shape * change.inverse();
    }
    now.centre -= now.shape * step.template head<2>();
    if (!now.centre.allFinite() || !now.shape.allFinite()) return std::nullopt;
    if ((now.centre - start.centre).cwiseAbs().maxCoeff() > reach) return std::nullopt;
    if (step.cwiseAbs().maxCoeff() < kConvergencePx) break;
  }
  if (now.correlation < min_correlation) return std::nullopt;
  return now;
}

}  // namespace

std::optional<Patch> extract_patch(const cv::Mat& gray, const Eigen::Vector2f& pixel, int window_px) {
  const int reach = window_px / 2 + 1;
  if (!pixel.allFinite() || pixel.cwiseAbs().maxCoeff() > 1e6F) return std::nullopt;
  const auto u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
  if (u < reach || v < reach || u >= gray.cols - reach || v >= gray.rows - reach) return std::nullopt;
  Patch patch;
  patch.offset = pixel - Eigen::Vector2f(static_cast<float>(u), static_cast<float>(v));
  const auto side = static_cast<size_t>(window_px) + 2;
  patch.grey.reserve(side * side);
  for (int row = v - reach; row <= v + reach; ++row) {
    const uint8_t* line = gray.ptr<uint8_t>(row) + u;
    patch.grey.insert(patch.grey.end(), line - reach, line + reach + 1);
  }
  return patch;
}

std::optional<PatchAlignment> align_patch(const Patch& patch, const cv::Mat& gray, const PatchAlignment& start,
                                          const PatchConfig& config) {
  PatchModel<2> rigid;
  PatchModel<6> model;
  return config.shape_std > 0.0 ? align(patch, model, gray, start, config) : align(patch, rigid, gray, start, config);
}

std::optional<PatchAlignment> align_patch(const Patch& patch, PatchModel<6>& model, const cv::Mat& gray,
                                          const PatchAlignment& start, const PatchConfig& config) {
  return align(patch, model, gray, start, config);
}

}  // namespace roadfix
