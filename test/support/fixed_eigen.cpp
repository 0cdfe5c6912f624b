// Every test program blocks Eigen's products as the processes do.
#include "geometry/determinism.h"

namespace {
[[maybe_unused]] const bool kFixed = (roadfix::fix_eigen_blocking(), true);
}  // namespace
