#include "recorder/sidecar.h"

#include <fmt/format.h>
#include <lcm/lcm.h>
#include <sys/utsname.h>

#include <Eigen/Core>
#include <fstream>
#include <nlohmann/json.hpp>

#include "bus/run/process_facts.h"
#include "bus/types/schema.h"
#include "type_text.h"

namespace roadfix {

void write_sidecar(const std::filesystem::path& path, const Sidecar& sidecar) {
  nlohmann::ordered_json json;
  json["format"] = "roadfix recording, 1";
  json["stopped_because"] = sidecar.stopped_because;
  json["unwritten"] = sidecar.unwritten;
  json["dropped"] = sidecar.dropped;
  json["deleted_files"] = sidecar.deleted_files;
  for (const SidecarFile& file : sidecar.files)
    json["files"].push_back({{"name", file.name},
                             {"first_utime", file.first_us},
                             {"last_utime", file.last_us},
                             {"bytes", file.bytes},
                             {"xxh64", fmt::format("{:016x}", file.hash)},
                             {"events", file.events}});
  json["versions"] = {{"lcm", fmt::format("{}.{}.{}", LCM_MAJOR_VERSION, LCM_MINOR_VERSION, LCM_MICRO_VERSION)},
                      {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
                      {"compiler", __VERSION__},
                      {"computing", library_versions()},
                      {"build", build_id()}};
  utsname host{};
  if (uname(&host) == 0) json["host"] = {{"name", host.nodename}, {"kernel", host.release}, {"machine", host.machine}};
  for (const TypeText& type : type_texts())
    json["types"].push_back(
        {{"name", type.name},
         {"fingerprint", fmt::format("{:016x}", static_cast<uint64_t>(Schema::built_in().fingerprint(type.name)))},
         {"text", type.text}});

  const std::filesystem::path part = path.string() + ".part";
  std::ofstream out(part);
  out << json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
  out.close();
  std::error_code error;
  if (out)
    std::filesystem::rename(part, path, error);
  else
    std::filesystem::remove(part, error);
}

}  // namespace roadfix
