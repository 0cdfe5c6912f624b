/// The foxglove.* message types that we write: names and numbers of their fields as docs.foxglove.dev/docs/sdk/schemas
/// has them, and the descriptor that goes into a file beside the messages.
#pragma once

#include <cstdint>
#include <vector>

#include "roadfix/export/protobuf_message.h"

namespace roadfix::foxglove {

// Numbers of fields, by message.
struct CompressedImage {
  static constexpr int kTimestamp = 1, kData = 2, kFormat = 3, kFrameId = 4;
};
struct RawImage {
  static constexpr int kTimestamp = 1, kWidth = 2, kHeight = 3, kEncoding = 4, kStep = 5, kData = 6, kFrameId = 7;
};
struct CameraCalibration {
  static constexpr int kTimestamp = 1, kWidth = 2, kHeight = 3, kDistortionModel = 4, kD = 5, kK = 6, kR = 7, kP = 8,
                       kFrameId = 9;
};
struct PoseInFrame {
  static constexpr int kTimestamp = 1, kFrameId = 2, kPose = 3;
};
struct Pose {
  static constexpr int kPosition = 1, kOrientation = 2;
};
struct FrameTransform {
  static constexpr int kTimestamp = 1, kParentFrameId = 2, kChildFrameId = 3, kTranslation = 4, kRotation = 5;
};
struct LocationFix {
  static constexpr int kLatitude = 1, kLongitude = 2, kAltitude = 3, kPositionCovariance = 4,
                       kPositionCovarianceType = 5, kTimestamp = 6, kFrameId = 7;
  static constexpr uint64_t kUnknown = 0, kKnown = 3;
};
struct Log {
  static constexpr int kTimestamp = 1, kLevel = 2, kMessage = 3, kName = 4;
  static constexpr uint64_t kInfo = 2, kWarning = 3, kError = 4;
};
struct PointsAnnotation {
  static constexpr int kTimestamp = 1, kType = 2, kPoints = 3, kOutlineColor = 4, kThickness = 7;
  static constexpr uint64_t kPointsType = 1, kLineList = 4;
};
struct ImageAnnotations {
  static constexpr int kPoints = 2;
};

/// A google.protobuf.FileDescriptorSet with all of them.
const std::vector<uint8_t>& descriptor_set();

/// google.protobuf.Timestamp of microseconds since 1970.
ProtobufMessage timestamp(int64_t utime);

}  // namespace roadfix::foxglove
