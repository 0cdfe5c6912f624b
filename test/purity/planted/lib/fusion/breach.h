// Not compiled: breaches that the purity test must find.
#include "gnss_ins/filter.h"
