/// CPU of vo_tracker's stage on a drive log, per left picture; prints one JSON object.
///   msckf_cost LOG VEHICLE_FOLDER
/// From before the first message to after the last, the whole process, all outputs made and thrown away. Pictures come
/// raw, as a camera gives them: what a JPEG or PNG costs to open is printed apart.
#include <cstdio>
#include <roadfix/image_t.hpp>

#include "bus/log/log_reader.h"
#include "bus/run/stage_runner.h"
#include "bus/types/message.h"
#include "geometry/determinism.h"
#include "program.h"
#include "vo_tracker/handler.h"
#include "vo_tracker/image.h"

namespace roadfix {
namespace {

using bench::cpu_ms;

class Nowhere final : public MessageSink {
 public:
  void put(const std::string& /*channel*/, const Header& /*header*/, std::span<const uint8_t> /*bytes*/) override {
    ++count;
  }
  int count = 0;
};

struct Offered {
  int input = 0;
  std::vector<uint8_t> bytes;
};

std::vector<uint8_t> raw_picture(std::span<const uint8_t> bytes) {
  auto message = decode<image_t>(bytes);
  const cv::Mat grey = grey_image(message);
  if (grey.empty()) return {bytes.begin(), bytes.end()};
  message.format = image_t::FORMAT_GRAY8;
  message.data.assign(grey.datastart, grey.dataend);
  message.size_bytes = static_cast<int32_t>(message.data.size());
  return encode(message);
}

int run(int argc, char** argv) {
  if (argc != 3) throw std::invalid_argument("usage: msckf_cost LOG VEHICLE_FOLDER");
  fix_eigen_blocking();
  Nowhere sink;
  StageRunner runner(make_vo_tracker(argv[2]), sink);
  const std::vector<InputSpec>& inputs = runner.spec().inputs;
  LogReader reader{std::string(argv[1])};
  std::vector<Offered> offered;
  int pictures = 0;
  double opening = 0.0;
  while (const auto event = reader.next()) {
    for (size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].channel != event->channel) continue;
      const bool picture = inputs[i].channel.starts_with("CAMERA");
      pictures += inputs[i].channel == "CAMERA_LEFT" ? 1 : 0;
      const double before = cpu_ms();
      offered.push_back({static_cast<int>(i), picture ? raw_picture(event->data)
                                                      : std::vector<uint8_t>(event->data.begin(), event->data.end())});
      if (picture) opening += cpu_ms() - before;
    }
  }
  if (pictures == 0) throw std::runtime_error(std::string(argv[1]) + ": no CAMERA_LEFT");
  const double begin = cpu_ms();
  for (const Offered& o : offered) runner.offer(o.input, o.bytes);
  const double spent = cpu_ms() - begin;
  std::printf("{\"pictures\": %d, \"cpu_ms\": %.3f, \"opening_ms\": %.3f, \"outputs\": %d}\n", pictures,
              spent / pictures, opening / pictures, sink.count);
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("msckf_cost", roadfix::run, argc, argv); }
