// Not compiled: breaches that the purity test must find.
#include "navigation/filter.h"
