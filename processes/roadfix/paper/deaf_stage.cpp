#include "roadfix/paper/deaf_stage.h"

#include <utility>

namespace roadfix {
namespace {

class DeafStage final : public Stage {
 public:
  DeafStage(int input, std::unique_ptr<Stage> stage) : input_(input), stage_(std::move(stage)) {}

  [[nodiscard]] const StageSpec& spec() const override { return stage_->spec(); }
  void apply(const Message& message) override {
    if (message.input != input_) stage_->apply(message);
  }
  void on_clock(const Message& message) override { stage_->on_clock(message); }
  void publish(int64_t now_utime, Outputs& outputs) override { stage_->publish(now_utime, outputs); }
  void digest(Digest& digest) const override { stage_->digest(digest); }
  [[nodiscard]] std::vector<uint8_t> save() const override { return stage_->save(); }
  void load(std::span<const uint8_t> state) override { stage_->load(state); }
  [[nodiscard]] bool wants_snapshot() const override { return stage_->wants_snapshot(); }
  [[nodiscard]] std::vector<uint8_t> memory() const override { return stage_->memory(); }
  [[nodiscard]] std::string effective_config() const override { return stage_->effective_config(); }
  [[nodiscard]] std::string effective_calibration() const override { return stage_->effective_calibration(); }

 private:
  int input_;
  std::unique_ptr<Stage> stage_;
};

}  // namespace

std::unique_ptr<Stage> deaf_to(const std::string& channel, std::unique_ptr<Stage> stage) {
  const std::vector<InputSpec>& inputs = stage->spec().inputs;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].channel == channel) return std::make_unique<DeafStage>(static_cast<int>(i), std::move(stage));
  }
  return stage;
}

}  // namespace roadfix
