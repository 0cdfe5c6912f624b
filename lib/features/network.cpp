#include "features/network.h"

#include <optional>
#include <stdexcept>

namespace roadfix {

namespace {

using Bytes = std::span<const uint8_t>;

/// Fields of one Protocol Buffers message (protobuf.dev, "Encoding"), as far as onnx.proto's declarations need them.
class Fields {
 public:
  explicit Fields(Bytes bytes) : rest_(bytes) {}

  struct Field {
    int number = 0;
    uint64_t value = 0;  ///< of a varint
    Bytes bytes;         ///< of a message or text
  };

  /// Nothing at the end, and at the first byte that makes no sense.
  std::optional<Field> next() {
    const std::optional<uint64_t> key = varint();
    if (!key) return std::nullopt;
    Field field;
    field.number = static_cast<int>(*key >> 3U);
    const uint64_t kind = *key & 7U;
    if (kind == 1 || kind == 5) return skip(kind == 1 ? 8 : 4) ? std::optional(field) : std::nullopt;
    const std::optional<uint64_t> value = varint();
    if (!value || (kind != 0 && kind != 2)) return std::nullopt;
    field.value = *value;
    if (kind == 0) return field;
    if (*value > rest_.size()) return std::nullopt;
    field.bytes = rest_.first(static_cast<size_t>(*value));
    skip(field.bytes.size());
    return field;
  }

 private:
  std::optional<uint64_t> varint() {
    uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      if (rest_.empty()) return std::nullopt;
      const uint8_t byte = rest_.front();
      skip(1);
      value |= static_cast<uint64_t>(byte & 0x7FU) << shift;
      if ((byte & 0x80U) == 0) return value;
    }
    return std::nullopt;
  }

  bool skip(size_t size) {
    if (size > rest_.size()) return false;
    rest_ = rest_.subspan(size);
    return true;
  }

  Bytes rest_;
};

/// Contents of the first field of this number; empty where there is none.
Bytes child(Bytes message, int number) {
  Fields fields(message);
  while (const auto field = fields.next()) {
    if (field->number == number) return field->bytes;
  }
  return {};
}

/// onnx.proto: ValueInfoProto.type.tensor_type.shape.dim[].dim_value; zero where a size has a name.
std::vector<uint64_t> declared_sizes(Bytes value_info) {
  std::vector<uint64_t> sizes;
  Fields dims(child(child(child(value_info, 2), 1), 2));
  while (const auto dim = dims.next()) {
    if (dim->number != 1) continue;
    sizes.push_back(0);
    Fields fields(dim->bytes);
    while (const auto field = fields.next()) {
      if (field->number == 1) sizes.back() = field->value;
    }
  }
  return sizes;
}

}  // namespace

int declared_channels(std::span<const uint8_t> onnx) {
  Fields graph(child(onnx, 7));
  while (const auto field = graph.next()) {
    if (field->number != 11) continue;
    const std::vector<uint64_t> sizes = declared_sizes(field->bytes);
    if (sizes.size() == 4 && sizes[0] <= 1 && (sizes[1] == 1 || sizes[1] == 3)) return static_cast<int>(sizes[1]);
  }
  return 1;
}

Network::Network(const std::string& name, std::span<const uint8_t> onnx)
    : name_(name), channels_(declared_channels(onnx)) {
  if (onnx.empty()) throw std::invalid_argument("front end " + name_ + ": needs its network (network_model)");
  try {
    net_ = cv::dnn::readNetFromONNX(reinterpret_cast<const char*>(onnx.data()), onnx.size());
    net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    for (const cv::String& output : net_.getUnconnectedOutLayersNames()) outputs_.push_back(output);
  } catch (const cv::Exception& e) {
    throw std::invalid_argument("front end " + name_ + ": no network that can be read: " + e.err);
  }
  if (outputs_.empty()) throw std::invalid_argument("front end " + name_ + ": the network has no output");
}

std::vector<cv::Mat> Network::run(const cv::Mat& gray) {
  cv::Mat picture = gray;
  if (channels_ == 3) cv::merge(std::vector<cv::Mat>{gray, gray, gray}, picture);
  std::vector<cv::Mat> results;
  try {
    net_.setInput(cv::dnn::blobFromImage(picture, 1.0 / 255.0));
    net_.forward(results, std::vector<cv::String>(outputs_.begin(), outputs_.end()));
  } catch (const cv::Exception& e) {
    throw std::invalid_argument("front end " + name_ + ": OpenCV cannot run this network: " + e.err);
  }
  for (const cv::Mat& result : results) {
    if (result.depth() != CV_32F || !result.isContinuous()) {
      throw std::invalid_argument("front end " + name_ + ": an output of the network is not of float");
    }
  }
  return results;
}

}  // namespace roadfix
