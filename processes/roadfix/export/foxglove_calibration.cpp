// Cameras of a calibration as viewers want them.
#include "config/calibration.h"
#include "config/config_error.h"
#include "roadfix/export/foxglove_schemas.h"
#include "roadfix/export/foxglove_views.h"

namespace roadfix {
namespace {

namespace fg = foxglove;

std::optional<ProtobufMessage> intrinsics(int64_t utime, const std::string& frame, const CameraCalibration& camera) {
  if (!camera.intrinsics_px || !camera.width_px || !camera.height_px) return std::nullopt;
  const Eigen::Vector4d& k = *camera.intrinsics_px;
  const double K[9] = {k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1};
  const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double P[12] = {k[0], 0, k[2], 0, 0, k[1], k[3], 0, 0, 0, 1, 0};
  using Field = fg::CameraCalibration;
  ProtobufMessage message;
  message.message(Field::kTimestamp, fg::timestamp(utime));
  message.fixed32(Field::kWidth, static_cast<uint32_t>(*camera.width_px));
  message.fixed32(Field::kHeight, static_cast<uint32_t>(*camera.height_px));
  const CameraDistortion distortion = camera.distortion.value_or(CameraDistortion{});
  std::vector<double> D = distortion.coefficients;
  if (distortion.model != DistortionModel::kEquidistant) D.resize(5);  // plumb_bob: k1 k2 p1 p2 k3
  message.text(Field::kDistortionModel,
               distortion.model == DistortionModel::kEquidistant ? "equidistant" : "plumb_bob");
  message.numbers(Field::kD, D);
  message.numbers(Field::kK, K);
  message.numbers(Field::kR, R);
  message.numbers(Field::kP, P);
  message.text(Field::kFrameId, frame);
  return message;
}

}  // namespace

FoxgloveViews FoxgloveViewer::views(const std::string& channel, const config_t& config) {
  if (config.calibration_yaml.empty() || config.calibration_yaml == last_calibration_) return {};
  last_calibration_ = config.calibration_yaml;
  Calibration calibration;
  try {
    calibration = parse_calibration(config.calibration_yaml, channel);
  } catch (const ConfigError&) {
    return {};  // of another version: the text itself is in the JSON message
  }
  FoxgloveViews views;
  for (const auto& [frame, camera] :
       {std::pair<std::string, std::optional<CameraCalibration>>{"CAMERA_LEFT", calibration.sensors.camera_left},
        {"CAMERA_RIGHT", calibration.sensors.camera_right}}) {
    if (!camera) continue;
    if (auto message = intrinsics(config.utime, frame, *camera)) {
      views.push_back({"CameraCalibration", "/" + frame + "/calibration", std::move(*message)});
    }
    if (!camera->mounting) continue;
    const SE3 T_body_camera = camera->mounting->T_body_camera();
    const Eigen::Vector3d& p = T_body_camera.p;
    const Eigen::Quaterniond& q = T_body_camera.q;
    ProtobufMessage transform;
    transform.message(fg::FrameTransform::kTimestamp, fg::timestamp(config.utime));
    transform.text(fg::FrameTransform::kParentFrameId, "vehicle");
    transform.text(fg::FrameTransform::kChildFrameId, frame);
    transform.vector(fg::FrameTransform::kTranslation, {p.x(), p.y(), p.z()});
    transform.vector(fg::FrameTransform::kRotation, {q.x(), q.y(), q.z(), q.w()});
    views.push_back({"FrameTransform", "/tf", std::move(transform)});
  }
  return views;
}

}  // namespace roadfix
