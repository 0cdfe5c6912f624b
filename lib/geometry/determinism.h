/// What makes Eigen give the same bits on every machine of one kind (docs/DESIGN.md, section 5).
#pragma once

namespace roadfix {

/// Fixes the cache sizes that Eigen reads from the processor and blocks its products by. Every main() calls it first.
void fix_eigen_blocking();

}  // namespace roadfix
