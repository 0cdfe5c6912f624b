/// A neural network from an ONNX file, run by OpenCV's DNN on the processor: the one engine, as Debian 12 packages no
/// ONNX Runtime.
#pragma once

#include <opencv2/dnn.hpp>
#include <span>
#include <string>
#include <vector>

namespace roadfix {

/// Channels of the first picture-shaped input (1 x C x H x W) that an ONNX file declares; 1 where it declares none.
int declared_channels(std::span<const uint8_t> onnx);

class Network {
 public:
  /// `name`: of the front end, for errors. Throws std::invalid_argument where the bytes are no network that can be read.
  Network(const std::string& name, std::span<const uint8_t> onnx);

  /// Runs on one grey picture in [0, 1], repeated over the channels that the network takes. All outputs, in the order
  /// of `outputs()`. Throws std::invalid_argument where the network cannot be run.
  std::vector<cv::Mat> run(const cv::Mat& gray);

  [[nodiscard]] const std::vector<std::string>& outputs() const { return outputs_; }

 private:
  std::string name_;
  cv::dnn::Net net_;
  std::vector<std::string> outputs_;
  int channels_ = 1;  ///< of its input
};

}  // namespace roadfix
