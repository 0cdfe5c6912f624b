// Learned front ends on networks of a few layers with known outputs: a corner is a bright pixel.
#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <random>

#include "features/front_end.h"
#include "features/keypoints.h"
#include "features/network.h"
#include "support/onnx_writer.h"

namespace roadfix {
namespace {

using Catch::Contains;
using test::OnnxWriter;

constexpr int kLength = 16;  ///< of the descriptors

std::vector<float> random_weights(std::size_t count) {
  std::mt19937 random(7);
  std::vector<float> out(count);
  for (float& w : out) w = static_cast<float>(random()) / 4294967296.0F - 0.5F;
  return out;
}

/// Logit 20 for a bright pixel's place in its cell against 10 for "no corner"; `reliable`: of the reliability's bias.
std::vector<uint8_t> xfeat_network(int channels, float reliable = 2.0F, int logits = 65) {
  OnnxWriter net(channels);
  std::vector<float> cells(static_cast<std::size_t>(logits) * 64, 0.0F);
  std::vector<float> bias(static_cast<std::size_t>(logits), 0.0F);
  for (std::size_t k = 0; k < 64; ++k) cells[k * 64 + k] = 20.0F;
  bias.back() = 10.0F;
  net.output(net.conv("x", kLength, 24, 8, 8, random_weights(kLength * 576), std::vector<float>(kLength, 0.0F)),
             {1, kLength, 8, 8});
  net.output(net.conv("x", logits, 8, 8, 0, cells, bias), {1, logits, 8, 8});
  net.output(net.layer("Sigmoid", net.conv("x", 1, 8, 8, 0, std::vector<float>(64, 0.0F), {reliable})), {1, 1, 8, 8});
  return net.file();
}

std::vector<uint8_t> aliked_maps(bool scores_first) {
  OnnxWriter net(3);
  const std::string scores = net.layer("Sigmoid", net.conv("x", 1, 1, 1, 0, {20.0F}, {-10.0F}));
  const std::string map =
      net.conv("x", kLength, 31, 1, 15, random_weights(kLength * 961), std::vector<float>(kLength, 0.0F));
  if (scores_first) net.output(scores, {1, 1, 64, 64});
  net.output(map, {1, kLength, 64, 64});
  if (!scores_first) net.output(scores, {1, 1, 64, 64});
  return net.file();
}

/// The same four keypoints whatever the picture.
std::vector<uint8_t> aliked_lists() {
  constexpr int64_t kNumber = 4;
  OnnxWriter net(3);
  const std::string mean = net.layer("GlobalAveragePool", "x");
  const auto constant = [&](const std::vector<float>& values, const std::vector<int64_t>& shape) {
    const auto count = static_cast<int>(values.size());
    const std::string name =
        net.reshape(net.conv(mean, count, 1, 1, 0, std::vector<float>(values.size(), 0.0F), values), shape);
    net.output(name, shape);
  };
  constant({-1.0F, -1.0F, 1.0F, 1.0F, 0.0F, 0.5F, 1.5F, 0.0F}, {1, kNumber, 2});  // the last lies outside
  constant({0.9F, 0.8F, 0.1F, 0.9F}, {1, kNumber});                               // the third is weak
  std::vector<float> descriptors(kNumber * kLength, 0.0F);
  for (std::size_t i = 0; i < kNumber; ++i) descriptors[i * kLength + i] = 3.0F;
  constant(descriptors, {1, kNumber, kLength});
  return net.file();
}

struct Dots {
  cv::Mat picture;
  std::vector<Eigen::Vector2f> places;
};

/// Bright squares of `size` pixels on dark noise, no two near each other.
Dots dots(int size, int shift_u = 0, int shift_v = 0) {
  constexpr int kMargin = 30;
  std::mt19937 random(3);
  cv::Mat noise(256 + 2 * kMargin, 640 + 2 * kMargin, CV_8UC1);
  for (int v = 0; v < noise.rows; ++v) {
    for (int u = 0; u < noise.cols; ++u) noise.at<uint8_t>(v, u) = static_cast<uint8_t>(random() % 60);
  }
  Dots out{noise(cv::Rect(kMargin - shift_u, kMargin - shift_v, 640, 256)).clone(), {}};
  for (int v = 40; v < 200; v += 24) {
    for (int u = 40; u < 580; u += 24) {
      const int du = static_cast<int>(random() % 6) * 2, dv = static_cast<int>(random() % 6) * 2;
      const int left = u + du + shift_u, top = v + dv + shift_v;
      out.picture(cv::Rect(left, top, size, size)).setTo(255);
      const float middle = 0.5F * static_cast<float>(size - 1);
      out.places.emplace_back(static_cast<float>(left) + middle, static_cast<float>(top) + middle);
    }
  }
  return out;
}

void check_places(KeypointDetector& detector, const Dots& scene, float tolerance) {
  const Keypoints found = detector.detect(scene.picture);
  REQUIRE(found.pixels.size() == scene.places.size());
  REQUIRE(found.scores.size() == found.pixels.size());
  REQUIRE(found.descriptors.rows == static_cast<int>(found.pixels.size()));
  for (const Eigen::Vector2f& place : scene.places) {
    float nearest = 1e9F;
    for (const Eigen::Vector2f& p : found.pixels) nearest = std::min(nearest, (p - place).norm());
    CHECK(nearest < tolerance);
  }
  for (int i = 0; i < found.descriptors.rows; ++i)
    CHECK(cv::norm(found.descriptors.row(i)) == Approx(1.0).margin(1e-5));
}

void check_tracks(FrontEndKind kind, const std::vector<uint8_t>& network) {
  FrontEndConfig config;
  config.kind = kind;
  const auto front_end = make_front_end(config, network);
  static_cast<void>(front_end->track(dots(1).picture, {}));
  std::map<int64_t, Eigen::Vector2f> begun;
  for (const Feature& f : front_end->replenish()) begun[f.track] = f.pixel;
  REQUIRE(begun.size() > 80);
  const std::vector<Feature> again = front_end->track(dots(1, 16, -8).picture, {});
  REQUIRE(again.size() > begun.size() * 9 / 10);
  for (const Feature& f : again) CHECK((f.pixel - begun.at(f.track) - Eigen::Vector2f(16.0F, -8.0F)).norm() < 0.01F);
}

TEST_CASE("xfeat: corners are where they are, in one channel and in three") {
  for (const int channels : {1, 3}) {
    const auto detector = make_xfeat({}, xfeat_network(channels));
    check_places(*detector, dots(1), 0.01F);
  }
  FrontEndConfig half;
  half.xfeat_scale = 0.5;
  check_places(*make_xfeat(half, xfeat_network(1)), dots(2), 0.01F);
}

TEST_CASE("xfeat: the score is the probability times the reliability") {
  const Keypoints sure = make_xfeat({}, xfeat_network(1, 2.0F))->detect(dots(1).picture);
  const Keypoints unsure = make_xfeat({}, xfeat_network(1, -2.0F))->detect(dots(1).picture);
  REQUIRE(sure.scores.size() == unsure.scores.size());
  CHECK(sure.scores[0] == Approx(1.0 / (1.0 + std::exp(-2.0))).margin(1e-3));
  CHECK(unsure.scores[0] == Approx(1.0 / (1.0 + std::exp(2.0))).margin(1e-3));
}

TEST_CASE("xfeat and aliked: tracks move with the picture") {
  check_tracks(FrontEndKind::kXFeat, xfeat_network(1));
  check_tracks(FrontEndKind::kAliked, aliked_maps(true));
}

TEST_CASE("aliked: maps in either order, at the picture's size and at half of it") {
  for (const bool scores_first : {true, false})
    check_places(*make_aliked({}, aliked_maps(scores_first)), dots(1), 0.01F);
  FrontEndConfig half;
  half.aliked_scale = 0.5;
  check_places(*make_aliked(half, aliked_maps(true)), dots(2), 0.01F);
}

TEST_CASE("aliked: lists of keypoints, without what is weak or outside") {
  const Keypoints found = make_aliked({}, aliked_lists())->detect(cv::Mat::zeros(256, 640, CV_8UC1));
  REQUIRE(found.pixels.size() == 2);
  CHECK((found.pixels[0] - Eigen::Vector2f(0.0F, 0.0F)).norm() < 1e-3F);
  CHECK((found.pixels[1] - Eigen::Vector2f(639.0F, 255.0F)).norm() < 1e-3F);
  CHECK(found.scores == std::vector<float>{0.9F, 0.8F});
  REQUIRE(found.descriptors.rows == 2);
  CHECK(found.descriptors.at<float>(0, 0) == Approx(1.0));
  CHECK(found.descriptors.at<float>(1, 1) == Approx(1.0));
}

TEST_CASE("a network's channels are read from its file, also from a broken one") {
  CHECK(declared_channels(xfeat_network(1)) == 1);
  CHECK(declared_channels(xfeat_network(3)) == 3);
  std::vector<uint8_t> bytes = xfeat_network(3);
  for (std::size_t cut = 0; cut < bytes.size(); cut += 7) CHECK(declared_channels(std::span(bytes).first(cut)) <= 3);
  std::mt19937 random(5);
  for (int i = 0; i < 20'000; ++i) {
    bytes[random() % 400] = static_cast<uint8_t>(random());
    const int channels = declared_channels(bytes);
    REQUIRE((channels == 1 || channels == 3));
  }
}

TEST_CASE("learned front ends refuse networks of another shape when they start") {
  CHECK_THROWS_WITH(make_xfeat({}, xfeat_network(1, 2.0F, 64)),
                    Contains("front end xfeat: the network does not give 65, 1 and N"));
  CHECK_THROWS_WITH(make_xfeat({}, aliked_lists()), Contains("65, 1 and N"));
  CHECK_THROWS_WITH(make_xfeat({}, xfeat_network(2)), Contains("OpenCV cannot run this network"));
  CHECK_THROWS_WITH(make_aliked({}, xfeat_network(1)), Contains("front end aliked: the network gives neither"));
  CHECK_THROWS_WITH(make_superpoint({}, xfeat_network(1)), Contains("has no output output_det"));
  CHECK_THROWS_WITH(make_xfeat({}, {}), Contains("needs its network (network_model)"));
  const std::vector<uint8_t> whole = xfeat_network(1);
  for (std::size_t cut = 1; cut < whole.size(); cut += 4999) {
    CHECK_THROWS_AS(make_xfeat({}, std::span(whole).first(cut)), std::invalid_argument);
  }
}

}  // namespace
}  // namespace roadfix
