#include "geometry/determinism.h"

#include <Eigen/Core>

namespace roadfix {

void fix_eigen_blocking() {
  constexpr std::ptrdiff_t kKibi = 1024;
  Eigen::setCpuCacheSizes(32 * kKibi, 256 * kKibi, 4096 * kKibi);
  Eigen::setNbThreads(1);
}

}  // namespace roadfix
