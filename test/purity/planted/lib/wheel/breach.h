// Not compiled: breaches that the purity test must find.
// A citation without its equation: (W.1.2).
#include <chrono>
#include "fusion/imm.h"
inline void breach() { std::cout << 1; }
