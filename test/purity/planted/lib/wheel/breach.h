// Not compiled: breaches that the purity test must find.
#include <chrono>
#include "fusion/imm.h"
inline void breach() { std::cout << 1; }
