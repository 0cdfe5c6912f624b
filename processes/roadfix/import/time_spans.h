/// Do the sensors of a recording share any time? Stamps in another unit or of another clock pass every check of a row.
#pragma once

#include "roadfix/import/drive.h"

namespace roadfix {

/// ConfigError with two files, their spans and what to do where a time without any sensor parts the drive in two. A
/// receiver that falls silent before a camera begins is none such: another sensor bridges it.
void refuse_times_apart(const Drive& drive);

}  // namespace roadfix
