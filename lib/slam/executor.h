/// The executor of the bundle adjustment: stream/executor.h.
#pragma once

#include "stream/executor.h"
