/// REFERENCE of a drive, and what the evaluation has to know about it.
#pragma once

#include <roadfix/pose_t.hpp>
#include <vector>

#include "roadfix/import/drive.h"
#include "roadfix/import/gnss_changes.h"

namespace roadfix {

struct DriveReference {
  std::vector<pose_t> poses;  ///< marked as evaluation/drive_facts.h says
  DriveFacts facts;
};

/// `drive` has its fixes as they were; `changed` says which of them the log lacks. The ENU anchor is the first point of
/// the reference. Without reference the fixes themselves are it, of the antenna. A reference that repeats the fixes
/// (same times, same places to kSamePlace) is known as such: facts.reference.from_fixes.
DriveReference make_reference(const Drive& drive, const ChangedGnss& changed, const GnssChanges& changes);

}  // namespace roadfix
