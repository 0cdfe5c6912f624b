#include "features/front_end.h"

#include <opencv2/core/utility.hpp>
#include <stdexcept>

#include "features/descriptor_tracks.h"
#include "features/klt_tracks.h"

namespace roadfix {

std::unique_ptr<FrontEnd> make_front_end(const FrontEndConfig& config, std::span<const uint8_t> superpoint_weights) {
  switch (config.kind) {
    case FrontEndKind::kOrb:
      return std::make_unique<DescriptorTracks>(config, make_orb(config));
    case FrontEndKind::kSift:
      return std::make_unique<DescriptorTracks>(config, make_sift(config));
    case FrontEndKind::kSuperPoint:
      return std::make_unique<DescriptorTracks>(config, make_superpoint(config, superpoint_weights));
    case FrontEndKind::kXFeat:
      return std::make_unique<DescriptorTracks>(config, make_xfeat(config, superpoint_weights));
    case FrontEndKind::kAliked:
      return std::make_unique<DescriptorTracks>(config, make_aliked(config, superpoint_weights));
    case FrontEndKind::kKlt:
      break;
  }
  return std::make_unique<KltTracks>(config);
}

void fix_opencv_threads() {
  // Once: the call tears TBB's arena down, under the feet of another thread that is within a loop of OpenCV.
  static const int threads = [] {
    cv::setNumThreads(1);
    return cv::getNumThreads();
  }();
  (void)threads;
}

}  // namespace roadfix
