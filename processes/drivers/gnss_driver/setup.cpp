#include "config/config.h"
#include "drivers/gnss_driver/ntrip_link.h"

namespace roadfix {

DriverSetup gnss_driver_setup(const GnssDriverConfig& config) {
  DriverSetup setup;
  setup.name = "gnss_driver";
  setup.raw_channels = {"RAW_GNSS"};
  setup.config = explained_config_text(config);
  setup.device = config.device;
  setup.make = [config] { return std::make_unique<GnssDriver>(config); };
  setup.open = [config](const auto&) { return open_byte_source(config.device); };
  if (config.ntrip) setup.make_companion = [ntrip = *config.ntrip] { return std::make_unique<NtripLink>(ntrip); };
  return setup;
}

DriverSetup gnss_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device) {
  auto config = load_config<GnssDriverConfig>(vehicle_dir / "gnss_driver.yaml");
  if (!device.empty()) config.device.device = device;
  return gnss_driver_setup(config);
}

}  // namespace roadfix
