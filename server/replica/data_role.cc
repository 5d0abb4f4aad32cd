// SPDX-License-Identifier: Apache-2.0
#include "server/replica/data_role.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/text/nesting.h"

namespace rigcal::server {
namespace {

constexpr const char* kNames[] = {"server", "standby", "promoted", "superseded"};

std::filesystem::path FileOf(const std::filesystem::path& data_dir) {
  return data_dir / "standby.json";
}

}  // namespace

absl::StatusOr<DataRole> ReadDataRole(const std::filesystem::path& data_dir) {
  const std::filesystem::path path = FileOf(data_dir);
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return DataRole();
  try {
    std::ifstream stream(path);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const auto file = ParseJson<nlohmann::json>(text);
    DataRole role;
    const auto name = file.at("role").get<std::string>();
    size_t number = 0;
    while (number < std::size(kNames) && name != kNames[number]) ++number;
    if (number == std::size(kNames)) throw std::runtime_error("its role is unknown");
    role.role = static_cast<RoleOfData>(number);
    role.standby_id = file.value("standby_id", "");
    role.primary = file.value("primary", "");
    role.complete = file.value("complete", false);
    role.generation = file.value("generation", uint64_t{0});
    role.superseded_by = file.value("superseded_by", "");
    return role;
  } catch (const std::exception& fault) {
    return absl::DataLossError(absl::StrCat(
        path.string(), " is damaged: ", fault.what(),
        "; it says whether this server follows another one: restore it from a backup, or remove "
        "it if this server follows none and none has taken over from it"));
  }
}

absl::Status WriteDataRole(const std::filesystem::path& data_dir, const DataRole& role) {
  const nlohmann::json file{{"role", kNames[static_cast<size_t>(role.role)]},
                            {"standby_id", role.standby_id},
                            {"primary", role.primary},
                            {"complete", role.complete},
                            {"generation", role.generation},
                            {"superseded_by", role.superseded_by}};
  return WriteDurableFile(FileOf(data_dir), file.dump(2) + "\n");
}

std::string WhyNotToServe(const DataRole& role) {
  switch (role.role) {
    case RoleOfData::kStandby:
      return absl::StrCat("this server is a standby of ", role.primary,
                          "; use that one. If it does not come back, run rigcal-server promote on "
                          "the standby's PC");
    case RoleOfData::kSuperseded:
      return absl::StrCat(
          "this server was replaced, another one has taken over with generation ", role.generation,
          role.superseded_by.empty() ? "" : absl::StrCat(" (", role.superseded_by, ")"),
          "; use that one. To make this one its standby, run rigcal-server --follow "
          "HOST:PORT, with a new data folder or with this one");
    case RoleOfData::kServer:
    case RoleOfData::kPromoted:
      break;
  }
  return "";
}

}  // namespace rigcal::server
