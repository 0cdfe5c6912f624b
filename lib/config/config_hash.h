/// Lives in lib/stream, where the bus can reach it too.
#pragma once

#include "stream/config_hash.h"
