#include "roadfix/export/foxglove_schemas.h"

#include <string>

#include "roadfix/export/protobuf_message.h"

namespace roadfix::foxglove {
namespace {

// google/protobuf/descriptor.proto: numbers of its fields, types and labels.
constexpr int kSetFile = 1;
constexpr int kFileName = 1, kFilePackage = 2, kFileDependency = 3, kFileMessage = 4, kFileEnum = 5, kFileSyntax = 12;
constexpr int kMessageName = 1, kMessageField = 2, kMessageEnum = 4;
constexpr int kFieldName = 1, kFieldNumber = 3, kFieldLabel = 4, kFieldType = 5, kFieldTypeName = 6;
constexpr int kEnumName = 1, kEnumValue = 2, kValueName = 1, kValueNumber = 2;
constexpr uint64_t kOptional = 1, kRepeated = 3;
enum Type : uint64_t {
  kDouble = 1,
  kInt64 = 3,
  kInt32 = 5,
  kFixed32 = 7,
  kString = 9,
  kMessage = 11,
  kBytes = 12,
  kEnum = 14
};

struct Field {
  const char* name;
  int number;
  Type type;
  const char* type_name = "";  ///< of a message or an enum, with its package
  uint64_t label = kOptional;
};

ProtobufMessage message(const char* name, const std::vector<Field>& fields) {
  ProtobufMessage descriptor;
  descriptor.text(kMessageName, name);
  for (const Field& field : fields) {
    ProtobufMessage one;
    one.text(kFieldName, field.name);
    one.varint(kFieldNumber, static_cast<uint64_t>(field.number));
    one.varint(kFieldLabel, field.label);
    one.varint(kFieldType, field.type);
    if (*field.type_name != '\0') one.text(kFieldTypeName, field.type_name);
    descriptor.message(kMessageField, one);
  }
  return descriptor;
}

ProtobufMessage enumeration(const char* name, const std::vector<const char*>& values) {
  ProtobufMessage descriptor;
  descriptor.text(kEnumName, name);
  for (std::size_t i = 0; i < values.size(); ++i) {
    ProtobufMessage value;
    value.text(kValueName, values[i]);
    value.varint(kValueNumber, i);
    descriptor.message(kEnumValue, value);
  }
  return descriptor;
}

constexpr const char* kTime = ".google.protobuf.Timestamp";
constexpr const char* kTimeFile = "google/protobuf/timestamp.proto";

ProtobufMessage time_file() {
  ProtobufMessage file;
  file.text(kFileName, kTimeFile);
  file.text(kFilePackage, "google.protobuf");
  file.message(kFileMessage, message("Timestamp", {{"seconds", 1, kInt64}, {"nanos", 2, kInt32}}));
  file.text(kFileSyntax, "proto3");
  return file;
}

/// Vectors and colours: doubles 1, 2, 3 ...
ProtobufMessage doubles(const char* name, const std::vector<const char*>& parts) {
  std::vector<Field> fields;
  for (const char* part : parts) fields.push_back({part, static_cast<int>(fields.size()) + 1, kDouble});
  return message(name, fields);
}

void add_pictures(ProtobufMessage& file) {
  file.message(kFileMessage, message("CompressedImage", {{"timestamp", CompressedImage::kTimestamp, kMessage, kTime},
                                                         {"data", CompressedImage::kData, kBytes},
                                                         {"format", CompressedImage::kFormat, kString},
                                                         {"frame_id", CompressedImage::kFrameId, kString}}));
  file.message(kFileMessage, message("RawImage", {{"timestamp", RawImage::kTimestamp, kMessage, kTime},
                                                  {"width", RawImage::kWidth, kFixed32},
                                                  {"height", RawImage::kHeight, kFixed32},
                                                  {"encoding", RawImage::kEncoding, kString},
                                                  {"step", RawImage::kStep, kFixed32},
                                                  {"data", RawImage::kData, kBytes},
                                                  {"frame_id", RawImage::kFrameId, kString}}));
  using Camera = CameraCalibration;
  file.message(kFileMessage, message("CameraCalibration", {{"timestamp", Camera::kTimestamp, kMessage, kTime},
                                                           {"width", Camera::kWidth, kFixed32},
                                                           {"height", Camera::kHeight, kFixed32},
                                                           {"distortion_model", Camera::kDistortionModel, kString},
                                                           {"D", Camera::kD, kDouble, "", kRepeated},
                                                           {"K", Camera::kK, kDouble, "", kRepeated},
                                                           {"R", Camera::kR, kDouble, "", kRepeated},
                                                           {"P", Camera::kP, kDouble, "", kRepeated},
                                                           {"frame_id", Camera::kFrameId, kString}}));
  using Points = PointsAnnotation;
  ProtobufMessage points =
      message("PointsAnnotation", {{"timestamp", Points::kTimestamp, kMessage, kTime},
                                   {"type", Points::kType, kEnum, ".foxglove.PointsAnnotation.Type"},
                                   {"points", Points::kPoints, kMessage, ".foxglove.Point2", kRepeated},
                                   {"outline_color", Points::kOutlineColor, kMessage, ".foxglove.Color"},
                                   {"thickness", Points::kThickness, kDouble}});
  points.message(kMessageEnum, enumeration("Type", {"UNKNOWN", "POINTS", "LINE_LOOP", "LINE_STRIP", "LINE_LIST"}));
  file.message(kFileMessage, points);
  file.message(kFileMessage, message("ImageAnnotations", {{"points", ImageAnnotations::kPoints, kMessage,
                                                           ".foxglove.PointsAnnotation", kRepeated}}));
}

void add_places(ProtobufMessage& file) {
  file.message(kFileMessage, message("PoseInFrame", {{"timestamp", PoseInFrame::kTimestamp, kMessage, kTime},
                                                     {"frame_id", PoseInFrame::kFrameId, kString},
                                                     {"pose", PoseInFrame::kPose, kMessage, ".foxglove.Pose"}}));
  file.message(kFileMessage, message("Pose", {{"position", Pose::kPosition, kMessage, ".foxglove.Vector3"},
                                              {"orientation", Pose::kOrientation, kMessage, ".foxglove.Quaternion"}}));
  using Transform = FrameTransform;
  file.message(kFileMessage,
               message("FrameTransform", {{"timestamp", Transform::kTimestamp, kMessage, kTime},
                                          {"parent_frame_id", Transform::kParentFrameId, kString},
                                          {"child_frame_id", Transform::kChildFrameId, kString},
                                          {"translation", Transform::kTranslation, kMessage, ".foxglove.Vector3"},
                                          {"rotation", Transform::kRotation, kMessage, ".foxglove.Quaternion"}}));
  using Fix = LocationFix;
  ProtobufMessage fix =
      message("LocationFix", {{"latitude", Fix::kLatitude, kDouble},
                              {"longitude", Fix::kLongitude, kDouble},
                              {"altitude", Fix::kAltitude, kDouble},
                              {"position_covariance", Fix::kPositionCovariance, kDouble, "", kRepeated},
                              {"position_covariance_type", Fix::kPositionCovarianceType, kEnum,
                               ".foxglove.LocationFix.PositionCovarianceType"},
                              {"timestamp", Fix::kTimestamp, kMessage, kTime},
                              {"frame_id", Fix::kFrameId, kString}});
  fix.message(kMessageEnum,
              enumeration("PositionCovarianceType", {"UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"}));
  file.message(kFileMessage, fix);
}

ProtobufMessage foxglove_file() {
  ProtobufMessage file;
  file.text(kFileName, "foxglove.proto");
  file.text(kFilePackage, "foxglove");
  file.text(kFileDependency, kTimeFile);
  file.message(kFileMessage, doubles("Vector3", {"x", "y", "z"}));
  file.message(kFileMessage, doubles("Quaternion", {"x", "y", "z", "w"}));
  file.message(kFileMessage, doubles("Point2", {"x", "y"}));
  file.message(kFileMessage, doubles("Color", {"r", "g", "b", "a"}));
  add_pictures(file);
  add_places(file);
  file.message(kFileMessage, message("Log", {{"timestamp", Log::kTimestamp, kMessage, kTime},
                                             {"level", Log::kLevel, kEnum, ".foxglove.LogLevel"},
                                             {"message", Log::kMessage, kString},
                                             {"name", Log::kName, kString}}));
  file.message(kFileEnum, enumeration("LogLevel", {"UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"}));
  file.text(kFileSyntax, "proto3");
  return file;
}

}  // namespace

const std::vector<uint8_t>& descriptor_set() {
  static const std::vector<uint8_t> bytes = [] {
    ProtobufMessage set;
    set.message(kSetFile, time_file());
    set.message(kSetFile, foxglove_file());
    return std::vector<uint8_t>(set.bytes().begin(), set.bytes().end());
  }();
  return bytes;
}

ProtobufMessage timestamp(int64_t utime) {
  constexpr int64_t kSecond = 1'000'000;
  const int64_t seconds = utime >= 0 ? utime / kSecond : (utime + 1) / kSecond - 1;
  ProtobufMessage time;
  time.varint(1, static_cast<uint64_t>(seconds));
  time.varint(2, static_cast<uint64_t>((utime - seconds * kSecond) * 1000));
  return time;
}

}  // namespace roadfix::foxglove
