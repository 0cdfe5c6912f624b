/// Pictures and poses as messages, for whoever writes a drive log; samples: bus/sample_codec.h. The caller numbers
/// them.
#pragma once

#include <roadfix/image_t.hpp>
#include <roadfix/pose_t.hpp>

#include "bus/sample_codec.h"
#include "roadfix/import/drive.h"

namespace roadfix {

/// The picture's own bytes; ConfigError where the file is gone or neither JPEG nor PNG.
image_t to_message(const FrameFile& frame);

/// A valid pose with nothing but time, scale and the origin's name.
pose_t empty_pose(int64_t t_us, ReferenceOf origin);
/// In ENU at the anchor; attitude and velocity turned from the axes at the point to the anchor's.
pose_t to_message(const ReferencePoint& point, const EnuAnchor& anchor, ReferenceOf origin, double sigma_m);
/// In the pose's own frame.
pose_t to_message(const LocalPose& pose, ReferenceOf origin, double sigma_m);

}  // namespace roadfix
