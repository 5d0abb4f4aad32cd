// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/raw_header.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxHeaderBytes = 64 * 1024;
constexpr char kKnownFormats[] = "known: EVT2 (2.0), EVT21 (2.1), EVT3 (3.0)";

template <typename... Pieces>
absl::Status Fault(size_t offset, const Pieces&... what) {
  return absl::InvalidArgumentError(absl::StrCat("RAW header, byte ", offset, ": ", what...));
}

bool IsText(std::string_view line) {
  return std::all_of(line.begin(), line.end(), [](char c) {
    return absl::ascii_isprint(static_cast<unsigned char>(c)) || c == '\t' || c == '\r';
  });
}

struct Encoding {
  const char* name;
  const char* version;
  EventFormat format;
};
constexpr Encoding kEncodings[] = {{"EVT3", "3.0", EventFormat::kEvt3},
                                   {"EVT2", "2.0", EventFormat::kEvt2},
                                   {"EVT21", "2.1", EventFormat::kEvt21}};

// Cameras whose files did not always state their geometry, by Prophesee's number of the system
// (OpenEB, hal_psee_plugins, device_system_id.h).
constexpr int kSystemsOf640x480[] = {0x19, 0x1D, 0x21, 0x22, 0x23, 0x28, 0x29};
constexpr int kSystemsOf1280x720[] = {0x1E, 0x1F, 0x20, 0x27, 0x2E, 0x30, 0x31, 0x32, 0x35, 0x3A};

std::optional<SensorGeometry> GeometryOfSystem(const std::string& number) {
  int system = 0;
  if (!absl::SimpleAtoi(number, &system)) return std::nullopt;
  if (std::ranges::find(kSystemsOf640x480, system) != std::end(kSystemsOf640x480)) {
    return SensorGeometry{640, 480};
  }
  if (std::ranges::find(kSystemsOf1280x720, system) != std::end(kSystemsOf1280x720)) {
    return SensorGeometry{1280, 720};
  }
  return std::nullopt;
}

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  absl::StatusOr<EventFileHeader> Run() {
    if (text_.empty() || text_.front() != '%') {
      return Fault(0,
                   "the file does not begin with '%', so it is not a RAW file of an event camera (",
                   kKnownFormats, ")");
    }
    while (header_.byte_count < text_.size() && text_[header_.byte_count] == '%') {
      const size_t end = text_.find('\n', header_.byte_count);
      if (end == text_.npos) {
        if (header_.fields.empty() || text_.size() >= kMaxHeaderBytes) {
          return Fault(header_.byte_count, "a line without an end; is this a RAW file?");
        }
        break;
      }
      const std::string_view line = text_.substr(header_.byte_count, end - header_.byte_count);
      // Without "% end", the first word of the events may happen to begin with '%'.
      if (!IsText(line)) break;
      const size_t offset = std::exchange(header_.byte_count, end + 1);
      RIGCAL_ASSIGN_OR_RETURN(const bool ended, TakeLine(line.substr(1), offset));
      if (ended) break;
    }
    return Finish();
  }

 private:
  absl::StatusOr<bool> TakeLine(std::string_view line, size_t offset) {
    const std::string text(absl::StripAsciiWhitespace(std::string(line)));
    if (text == "end") return true;
    const std::pair<std::string, std::string> field = absl::StrSplit(text, absl::MaxSplits(' ', 1));
    if (field.first.empty()) return false;
    header_.fields[field.first] = field.second;
    if (field.first == "evt") return TakeFormat(field.second, offset);
    if (field.first == "format") return TakeFormatLine(field.second, offset);
    if (field.first == "geometry") {
      const std::pair<std::string, std::string> sides =
          absl::StrSplit(field.second, absl::MaxSplits('x', 1));
      return TakeGeometry(sides.first, sides.second, offset);
    }
    return false;
  }

  // All return false: the header continues.
  absl::StatusOr<bool> TakeFormat(const std::string& text, size_t offset) {
    const std::string name = absl::AsciiStrToUpper(text);
    const auto* const known =
        std::find_if(std::begin(kEncodings), std::end(kEncodings),
                     [&](const Encoding& e) { return name == e.name || name == e.version; });
    if (known == std::end(kEncodings)) {
      return Fault(offset, "format \"", text, "\" is not known (", kKnownFormats, ")");
    }
    if (!header_.format_name.empty() && known->format != header_.format) {
      return Fault(offset, "format \"", text, "\" contradicts an earlier line of this header");
    }
    header_.format = known->format;
    header_.format_name = known->name;
    return false;
  }

  absl::StatusOr<bool> TakeFormatLine(const std::string& value, size_t offset) {
    const std::vector<std::string> parts = absl::StrSplit(value, ';');
    RIGCAL_RETURN_IF_ERROR(TakeFormat(parts.front(), offset).status());
    std::string width, height;
    for (size_t i = 1; i < parts.size(); ++i) {
      const std::pair<std::string, std::string> part = absl::StrSplit(parts[i], '=');
      if (part.first == "width") width = part.second;
      if (part.first == "height") height = part.second;
      if (part.first == "endianness") {
        header_.states_endianness = true;
        header_.halves_swapped = part.second == "legacy";
      }
    }
    if (width.empty() && height.empty()) return false;
    return TakeGeometry(width, height, offset);
  }

  absl::StatusOr<bool> TakeGeometry(std::string_view width, std::string_view height,
                                    size_t offset) {
    const auto geometry = ParseSensorGeometry(width, height);
    if (!geometry) {
      return Fault(offset, "geometry ", std::string(width), " x ", std::string(height),
                   " is not 1 to ", kMaxSensorSide, " pixels each way");
    }
    if (header_.geometry && *header_.geometry != *geometry) {
      return Fault(offset, "geometry ", FormatSensorGeometry(*geometry), " contradicts ",
                   FormatSensorGeometry(*header_.geometry), " of an earlier line");
    }
    header_.geometry = geometry;
    return false;
  }

  absl::StatusOr<EventFileHeader> Finish() {
    if (header_.format_name.empty()) {
      return Fault(header_.byte_count,
                   "no line \"% evt\" or \"% format\" says how "
                   "the events are encoded (",
                   kKnownFormats, ")");
    }
    if (const auto plugin = header_.fields.find("plugin_name");
        !header_.geometry && plugin != header_.fields.end() &&
        plugin->second.find("gen3") != std::string::npos) {
      header_.geometry = SensorGeometry{640, 480};
    }
    if (const auto system = header_.fields.find("system_ID");
        !header_.geometry && system != header_.fields.end()) {
      header_.geometry = GeometryOfSystem(system->second);
    }
    return std::move(header_);
  }

  const std::string_view text_;
  EventFileHeader header_;
};

}  // namespace

absl::StatusOr<EventFileHeader> ParseRawHeader(std::span<const uint8_t> bytes) {
  const size_t size = std::min(bytes.size(), kMaxHeaderBytes);
  return Parser({reinterpret_cast<const char*>(bytes.data()), size}).Run();
}

}  // namespace rigcal::agent
