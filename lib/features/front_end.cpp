#include "features/front_end.h"

#include <opencv2/core/utility.hpp>
#include <stdexcept>

#include "features/klt_tracks.h"

namespace roadfix {

std::unique_ptr<FrontEnd> make_front_end(const FrontEndConfig& config, std::span<const uint8_t>) {
  if (config.kind == FrontEndKind::kKlt) return std::make_unique<KltTracks>(config);
  throw std::invalid_argument("front end: only klt is built in");
}

void fix_opencv_threads() { cv::setNumThreads(1); }

}  // namespace roadfix
