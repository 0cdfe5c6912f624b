#include "features/patch_track.h"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace roadfix {
namespace {

constexpr float kMaxAreaChange = 1.5F;           ///< change of a patch's area, or its inverse, before the template is
                                                 ///< updated
constexpr float kMinTemplateCorrelation = 0.9F;  ///< below it the template is updated

}  // namespace

std::optional<PatchTrack> PatchTrack::begin(const cv::Mat& gray, const Eigen::Vector2f& pixel, int window_px) {
  PatchTrack track;
  track.pixel_ = pixel;
  if (!track.update_template(gray, window_px)) return std::nullopt;
  return track;
}

bool PatchTrack::update_template(const cv::Mat& gray, int window_px) {
  auto fresh = extract_patch(gray, pixel_, window_px);
  if (!fresh) return false;
  patch_ = std::move(*fresh);
  model_ = {};
  template_pixel_ = pixel_;
  alignment_ = {pixel_ - patch_.offset};
  return true;
}

bool PatchTrack::align(const cv::Mat& gray, const Eigen::Vector2f& near, float reach_px,
                       const std::optional<PerspectiveBend>& perspective, const FrontEndConfig& config) {
  const PatchConfig patch_config{config.klt_window_px, config.klt_min_correlation, config.klt_shape_std, reach_px};
  PatchAlignment start;
  start.shape = alignment_.shape;
  start.centre = near - start.shape * patch_.offset;
  const auto found = patch_config.shape_std > 0.0 ? align_patch(patch_, model_, gray, start, patch_config)
                                                  : align_patch(patch_, gray, start, patch_config);
  if (!found) return false;
  alignment_ = *found;
  pixel_ = alignment_.point(patch_);
  if (perspective) {
    const PatchBend bend =
        perspective->of(template_pixel_.cast<double>(), pixel_.cast<double>(), alignment_.shape.cast<double>());
    pixel_ -= alignment_.shape * model_.shift(bend);
  }
  return true;
}

bool PatchTrack::template_outdated() const {
  const float growth = std::abs(alignment_.shape.determinant());
  return growth > kMaxAreaChange || growth < 1.0F / kMaxAreaChange || alignment_.correlation < kMinTemplateCorrelation;
}

void PatchTrack::save(StateWriter& writer) const {
  writer.put(pixel_);
  writer.put(std::span<const uint8_t>(patch_.grey));
  writer.put(patch_.offset);
  writer.put(template_pixel_);
  writer.put(alignment_.centre);
  writer.put(alignment_.shape);
  writer.put(alignment_.correlation);
}

void PatchTrack::load(StateReader& reader, int window_px) {
  const auto side = static_cast<size_t>(window_px) + 2;
  reader.get(pixel_);
  reader.get(patch_.grey);
  if (patch_.grey.size() != side * side) throw std::runtime_error("state: a patch of the wrong size");
  reader.get(patch_.offset);
  reader.get(template_pixel_);
  reader.get(alignment_.centre);
  reader.get(alignment_.shape);
  reader.get(alignment_.correlation);
  model_ = {};
}

}  // namespace roadfix
