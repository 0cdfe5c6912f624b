/// Tests common to the descriptor front ends, and their localisation accuracy.
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <utility>

#include "features/descriptor_tracks.h"
#include "features/front_end.h"
#include "features/keypoints.h"
#include "support/pictures.h"
#include "support/shared_data.h"

namespace roadfix {
namespace {

using test::shifted;
using test::texture;

struct Kind {
  FrontEndKind kind;
  double median_px;  ///< limit of the median error
  double share;      ///< of tracks found again, lower limit
  size_t least;      ///< tracks started, lower limit
};

std::vector<uint8_t> superpoint_weights() {
  const auto path = test::shared_path("models/superpoint_student_mbv1.onnx");
  if (!path) return {};
  std::ifstream file(*path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

FrontEndConfig config_of(FrontEndKind kind) {
  FrontEndConfig config;
  config.kind = kind;
  return config;
}

/// Errors of the tracks found again after a known shift of the image.
std::vector<float> errors_after_move(FrontEnd& front_end, double du, double dv, size_t& begun_count) {
  const cv::Mat first = texture(640, 240, 5, 9);
  CHECK(front_end.track(first, {}).empty());
  std::map<int64_t, Eigen::Vector2f> begun;
  for (const Feature& f : front_end.replenish()) begun[f.track] = f.pixel;
  begun_count = begun.size();
  const Eigen::Vector2f move(static_cast<float>(du), static_cast<float>(dv));
  std::vector<float> errors;
  for (const Feature& f : front_end.track(shifted(first, du, dv), {})) {
    errors.push_back((f.pixel - begun.at(f.track) - move).norm());
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

void check_moves(const Kind& kind, std::span<const uint8_t> weights) {
  const auto front_end = make_front_end(config_of(kind.kind), weights);
  size_t begun = 0;
  const auto errors = errors_after_move(*front_end, 7.25, -3.5, begun);
  REQUIRE(begun >= kind.least);
  CHECK(front_end->num_expected() == static_cast<int>(begun));
  REQUIRE(static_cast<double>(errors.size()) > kind.share * static_cast<double>(begun));
  CHECK(errors[errors.size() / 2] < static_cast<float>(kind.median_px));
}

void check_drop_and_state(FrontEndKind kind, std::span<const uint8_t> weights) {
  const auto front_end = make_front_end(config_of(kind), weights);
  const cv::Mat image = texture(640, 240, 5, 9);
  (void)front_end->track(image, {});
  const auto begun = front_end->replenish();
  REQUIRE(begun.size() > 10);
  const std::vector<int64_t> dropped{begun[0].track, begun[1].track};
  front_end->drop(dropped);
  StateWriter writer;
  front_end->save(writer);
  const std::vector<uint8_t> state = writer.take();
  const auto resumed = make_front_end(config_of(kind), weights);
  StateReader reader(state);
  resumed->load(reader);
  reader.finish();
  const cv::Mat next = shifted(image, 3.0, 1.0);
  const auto a = front_end->track(next, {}), b = resumed->track(next, {});
  REQUIRE(a.size() == b.size());
  REQUIRE(!a.empty());
  for (size_t i = 0; i < a.size(); ++i) {
    REQUIRE(a[i].track == b[i].track);
    REQUIRE(a[i].pixel == b[i].pixel);
    REQUIRE(a[i].track > dropped[1]);
  }
  for (const Feature& f : front_end->replenish()) REQUIRE(f.track > begun.back().track);
  for (int i = 0; i < 6; ++i) CHECK(front_end->track(cv::Mat::zeros(240, 640, CV_8UC1), {}).empty());
  CHECK(front_end->track(image, {}).empty());  // after this many dark images all tracks have ended
}

TEST_CASE("every front end finds tracks again after a shift") {
  check_moves({FrontEndKind::kKlt, 0.1, 0.7, 80}, {});
  check_moves({FrontEndKind::kOrb, 0.1, 0.7, 80}, {});
  check_moves({FrontEndKind::kSift, 0.1, 0.7, 80}, {});
}

TEST_CASE("every front end drops, saves and loads tracks consistently") {
  for (const auto kind : {FrontEndKind::kKlt, FrontEndKind::kOrb, FrontEndKind::kSift}) check_drop_and_state(kind, {});
}

/// ORB that sees nothing where it is told so, and whose keypoints lie beside their corners after the first image.
class PoorDetector final : public KeypointDetector {
 public:
  PoorDetector(const FrontEndConfig& config, const bool& blind, float beside_px)
      : orb_(make_orb(config)), blind_(blind), beside_px_(beside_px) {}

  Keypoints detect(const cv::Mat& gray) override {
    if (blind_) return {};
    Keypoints found = orb_->detect(gray);
    if (std::exchange(first_, false)) return found;
    for (size_t i = 0; i < found.pixels.size(); ++i) found.pixels[i].x() += i % 2 == 0 ? beside_px_ : -beside_px_;
    return found;
  }
  [[nodiscard]] double max_distance() const override { return orb_->max_distance(); }

 private:
  std::unique_ptr<KeypointDetector> orb_;
  const bool& blind_;
  float beside_px_;
  bool first_ = true;
};

TEST_CASE("a corner that is not detected is followed by its patch for five images") {
  bool blind = false;
  const FrontEndConfig config = config_of(FrontEndKind::kOrb);
  DescriptorTracks tracks(config, std::make_unique<PoorDetector>(config, blind, 0.0F));
  const cv::Mat first = texture(640, 240, 5, 9);
  (void)tracks.track(first, {});
  std::map<int64_t, Eigen::Vector2f> begun;
  for (const Feature& f : tracks.replenish()) begun[f.track] = f.pixel;
  REQUIRE(begun.size() > 80);
  blind = true;
  for (int image = 1; image <= 5; ++image) {
    const double moved = 1.3 * image;
    const auto found = tracks.track(shifted(first, moved, 0.0), {});
    REQUIRE(found.size() > begun.size() * 7 / 10);
    std::vector<float> errors;
    for (const Feature& f : found)
      errors.push_back((f.pixel - begun.at(f.track) - Eigen::Vector2f(static_cast<float>(moved), 0.0F)).norm());
    std::sort(errors.begin(), errors.end());
    CHECK(errors[errors.size() / 2] < 0.1F);
  }
  CHECK(tracks.track(shifted(first, 7.8, 0.0), {}).empty());
}

TEST_CASE("a keypoint that lies beside its corner does not move the track") {
  const bool blind = false;
  const FrontEndConfig config = config_of(FrontEndKind::kOrb);
  const auto median_error = [&](float beside_px) {
    DescriptorTracks tracks(config, std::make_unique<PoorDetector>(config, blind, beside_px));
    size_t begun = 0;
    const auto errors = errors_after_move(tracks, 7.25, -3.5, begun);
    return errors.size() > begun / 3 ? errors[errors.size() / 2] : 1e9F;
  };
  CHECK(median_error(1.5F) < 0.1F);
  CHECK(median_error(5.0F) > 1.0F);  // out of the patch's reach
}

TEST_CASE("superpoint runs with user-supplied weights") {
  const auto weights = superpoint_weights();
  if (weights.empty()) return;
  check_moves({FrontEndKind::kSuperPoint, 0.1, 0.6, 10}, weights);  // few corners in synthetic texture
}

TEST_CASE("superpoint reports missing or unsuitable weights") {
  CHECK_THROWS_AS(make_front_end(config_of(FrontEndKind::kSuperPoint)), std::invalid_argument);
  const std::vector<uint8_t> junk(100, 7);
  CHECK_THROWS_AS(make_front_end(config_of(FrontEndKind::kSuperPoint), junk), std::invalid_argument);
}

TEST_CASE("descriptors of shifted corners are close, of other corners distant") {
  const cv::Mat first = texture(320, 200, 11, 7), second = shifted(first, 5.0, 2.0);
  std::vector<Eigen::Vector2f> a, b;
  for (int i = 0; i < 40; ++i) {
    a.emplace_back(40.0F + 5.0F * static_cast<float>(i), 60.0F + static_cast<float>(i % 7) * 9.0F);
    b.emplace_back(a.back() + Eigen::Vector2f(5.0F, 2.0F));
  }
  a.emplace_back(2.0F, 2.0F);  // too close to the edge
  const DescribedCorners da = describe_corners(first, a), db = describe_corners(second, b);
  REQUIRE(da.index.size() == 40);
  REQUIRE(db.index.size() == 40);
  double same = 0.0, other = 0.0;
  for (int i = 0; i < 40; ++i) {
    same += descriptor_distance(da.descriptors, i, db.descriptors, i) / 40.0;
    other += descriptor_distance(da.descriptors, i, db.descriptors, (i + 20) % 40) / 40.0;
  }
  CHECK(same < 10.0);
  CHECK(other > 70.0);
}

}  // namespace
}  // namespace roadfix
