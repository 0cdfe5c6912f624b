// Writes what the devices' fuzz targets begin with, FOLDER/PROTOCOL/NAME: streams as devices send them, each with the
// byte that says how the target reads it (device_fuzz.cpp).
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/protocols/utc.h"
#include "support/receiver_bytes.h"
#include "support/sbg_logs.h"

namespace roadfix::test {
namespace {

constexpr uint8_t kAsItIs = 0, kSealed = 1, kUtc = 2, kPieces = 4;  // kPieces and more: another way to cut

class Seeds {
 public:
  explicit Seeds(std::filesystem::path folder) : folder_(std::move(folder)) {}

  void add(const std::string& protocol, const std::string& name, uint8_t how, const Bytes& stream) const {
    std::filesystem::create_directories(folder_ / protocol);
    std::ofstream file(folder_ / protocol / name, std::ios::binary);
    file.put(static_cast<char>(how));
    file.write(reinterpret_cast<const char*>(stream.data()), static_cast<std::streamsize>(stream.size()));
    if (!file) throw std::runtime_error((folder_ / protocol / name).string() + ": cannot be written");
  }

 private:
  std::filesystem::path folder_;
};

Bytes joined(const std::vector<Bytes>& parts) {
  Bytes bytes;
  for (const Bytes& part : parts) append(bytes, part);
  return bytes;
}

void ubx_seeds(const Seeds& seeds) {
  const int64_t begin = *utc_us(2024, 5, 3, 23, 59, 59);
  Bytes epochs;
  for (uint32_t i = 0; i < 3; ++i) {
    const uint32_t tow = 1000 + 200 * i;
    append(epochs, pvt_bytes(begin + 200'000 * int64_t{i}, tow, 48.0));
    append(epochs, relposned_bytes(tow, 100.0));
    append(epochs, ubx_bytes(1, 0x61, Payload(4).at<uint32_t>(0, tow).bytes()));
  }
  seeds.add("ubx", "epochs", kSealed, epochs);
  // 2023-11-14 22:13:20 is the first reading's utime, so that the receiver's UTC is near it.
  Payload now(92);
  now.at<uint16_t>(4, 2023).at<uint8_t>(6, 11).at<uint8_t>(7, 14).at<uint8_t>(8, 22).at<uint8_t>(9, 13);
  now.at<uint8_t>(10, 20).at<uint8_t>(11, 3).at<uint8_t>(20, 3).at<uint8_t>(21, 1).at<uint32_t>(40, 900);
  now.at<uint32_t>(44, 900).at<uint32_t>(68, 100).at<int32_t>(16, -100'000'000);
  seeds.add("ubx", "utc", kSealed | kUtc | 3 * kPieces, ubx_bytes(1, 7, now.bytes()));
  Payload v0(40);
  v0.at<uint32_t>(4, 1000).at<int32_t>(8, 100).at<int32_t>(12, -50).at<uint32_t>(24, 100).at<uint32_t>(28, 100);
  v0.at<uint32_t>(36, 0x37);
  seeds.add("ubx", "relpos_v0", kSealed | kPieces, joined({ubx_bytes(1, 0x3C, v0.bytes()), epochs}));
  seeds.add("ubx", "noise", kAsItIs | 9 * kPieces,
            joined({from_hex("B562 0107 FF0F 00 B5"), epochs, rtcm_bytes({0x3E, 0xD0}), bytes_of("$GPGGA,*00\r\n")}));
}

void nmea_seeds(const Seeds& seeds) {
  const int64_t begin = *utc_us(2024, 5, 3, 23, 59, 59);
  Bytes epochs;
  for (int i = 0; i < 3; ++i)
    append(epochs, nmea_epoch_bytes(begin + int64_t{200'000} * i, i != 1, i == 2 ? "4" : "1", "120.0,M,47.5,M"));
  seeds.add("nmea", "epochs", kSealed | 5 * kPieces, epochs);
  seeds.add("nmea", "utc", kSealed | kUtc, nmea_epoch_bytes(*utc_us(2023, 11, 14, 22, 13, 20), true, "5", "1,M,,M"));
  seeds.add("nmea", "odd", kSealed | kPieces,
            joined({nmea_bytes("GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A"), nmea_bytes("GPHDT,274.07,T"),
                    nmea_bytes("GNTHS,12.5,A"), nmea_bytes("PUBX,00,1"), bytes_of("$GPGGA,12\r\n$$*4"),
                    nmea_bytes("GNGGA,235960.99,9000.0,S,18000.0,W,6,0,0,-1e3,M,nan,M,0,")}));
}

void sbg_seeds(const Seeds& seeds) {
  Bytes logs;
  for (uint32_t i = 0; i < 3; ++i) {
    const uint32_t t = 4'294'960'000U + 5000U * i;  // over the wrap
    append(logs, sbg_imu_bytes(t));
    append(logs, sbg_gps_bytes(t, 200 * i));
    append(logs, sbg_solution_bytes(t));
  }
  seeds.add("sbg", "logs", kSealed | 2 * kPieces, logs);
  seeds.add("sbg", "large_page", kSealed, joined({sbg_bytes(31, Bytes(20, 1), 0x80), sbg_imu_bytes(1)}));
  seeds.add("sbg", "noise", kAsItIs | 11 * kPieces, joined({from_hex("FF5A 2C 00 F00F FF FF 5A"), logs}));
}

void can_seeds(const Seeds& seeds) {
  const std::string lines =
      "(1700000000.000000) can0 123#E803112233445566\n(1700000000.010000) can0 18FEF100#01\n"
      "(1700000000.020000) vcan0 123##0E803112233445566778899AABB\n(1700000000.030000) can0 123#R\nx\n"
      "(1700000000.040000) can0 20000004#0010000000000000\n(1700000000.050000) can0 123#E903\n";
  seeds.add("can", "lines", kPieces, bytes_of(lines));
  const std::string mapping =
      "device: 'can:can0'\nspeeds: [{frame: '0x123', start_bit: 7, length: 16, byte_order: big, factor: 1.0e-2, "
      "invalid: [65535]}]\ndirection: {frame: '18FEF100', length: 3}\nforward: [1]\nreverse: [7]\n"
      "yaw_rate: {frame: '123', start_bit: 16, length: 64, signed: true, offset: -4}\nmax_age_s: 0.5\n";
  seeds.add("can", "mapping", 7 * kPieces, joined({bytes_of(mapping), {0}, bytes_of(lines)}));
  std::string four = "{device: 'can:x', speeds_signed: true, speeds: [";
  for (const char* frame : {"{frame: '1'}, ", "{frame: '1', start_bit: 8}, ", "{frame: '2'}, ", "{frame: '2'}"})
    four += frame;
  seeds.add("can", "four", kPieces,
            joined({bytes_of(four + "]}"), {0}, bytes_of("(1.000000) can0 001#0102\n(1.010000) can0 002#03\n")}));
}

void correction_seeds(const Seeds& seeds) {
  const Bytes frames = joined({rtcm_bytes({0x3E, 0xD0, 0x01}), rtcm_bytes(Bytes(300, 0xD3)), rtcm_bytes({0x43, 0x50})});
  seeds.add("corrections", "icy", kSealed | 6 * kPieces, joined({bytes_of("ICY 200 OK\r\n\r\n"), frames}));
  const std::string chunked = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\nContent-Type: gnss/data\r\n\r\n";
  char length[16];
  std::snprintf(length, sizeof length, "%zx;x=1\r\n", frames.size());
  seeds.add("corrections", "chunked", kPieces,
            joined({bytes_of(chunked + length), frames, bytes_of("\r\n1\r\n\xD3\r\n0\r\n\r\n")}));
  seeds.add("corrections", "refused", kPieces, bytes_of("HTTP/1.1 401 Unauthorized\r\n\r\n"));
  seeds.add("corrections", "table", kPieces, bytes_of("SOURCETABLE 200 OK\r\nSTR;X\r\n"));
}

}  // namespace
}  // namespace roadfix::test

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: device_seeds FOLDER\n");
    return 2;
  }
  const roadfix::test::Seeds seeds(argv[1]);
  roadfix::test::ubx_seeds(seeds);
  roadfix::test::nmea_seeds(seeds);
  roadfix::test::sbg_seeds(seeds);
  roadfix::test::can_seeds(seeds);
  roadfix::test::correction_seeds(seeds);
  return 0;
}
