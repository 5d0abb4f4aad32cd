// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/frame_times.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "common/text/line_reader.h"

namespace rigcal::agent {
namespace {

constexpr size_t kDigitsOfATime = 10;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The run of digits that begins at `begin`.
std::string_view DigitsAt(std::string_view text, size_t begin) {
  size_t end = begin;
  while (end < text.size() && IsDigit(text[end])) ++end;
  return text.substr(begin, end - begin);
}

std::string_view WithoutLeadingZeros(std::string_view digits) {
  const size_t first = digits.find_first_not_of('0');
  return first == digits.npos ? digits.substr(digits.size() - 1) : digits.substr(first);
}

struct TimeLine {
  std::string name;  // empty: a line with a time alone
  std::optional<int64_t> time_ns;
};

TimeLine ParseTimeLine(std::string_view text) {
  TimeLine line;
  std::string_view time = text;
  if (const size_t semicolon = text.rfind(';'); semicolon != text.npos) {
    line.name = text.substr(0, semicolon);
    absl::StripAsciiWhitespace(&line.name);
    time = text.substr(semicolon + 1);
  }
  int64_t time_ns = 0;
  if (absl::SimpleAtoi(std::string(time), &time_ns)) line.time_ns = time_ns;
  return line;
}

}  // namespace

bool NaturallyBefore(std::string_view a, std::string_view b) {
  size_t i = 0;
  size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (IsDigit(a[i]) && IsDigit(b[j])) {
      const std::string_view run_a = DigitsAt(a, i);
      const std::string_view run_b = DigitsAt(b, j);
      const std::string_view value_a = WithoutLeadingZeros(run_a);
      const std::string_view value_b = WithoutLeadingZeros(run_b);
      if (value_a.size() != value_b.size()) return value_a.size() < value_b.size();
      if (value_a != value_b) return value_a < value_b;
      i += run_a.size();
      j += run_b.size();
      continue;
    }
    if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
    ++i;
    ++j;
  }
  if (i == a.size() && j == b.size()) return a < b;
  return i == a.size();
}

std::optional<int64_t> TimeFromName(std::string_view name) {
  std::string_view last;
  for (size_t i = 0; i < name.size();) {
    const std::string_view digits = DigitsAt(name, i);
    if (digits.size() >= kDigitsOfATime) last = digits;
    i += std::max<size_t>(digits.size(), 1);
  }
  int64_t time_ns = 0;
  if (last.empty() || !absl::SimpleAtoi(std::string(last), &time_ns)) return std::nullopt;
  return time_ns;
}

absl::StatusOr<FrameTimes> ReadImageTimes(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(LineReader reader, LineReader::Open(path));
  FrameTimes times;
  bool is_first = true;
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<LineReader::Line> line, reader.Next());
    if (!line) return times;
    const std::string_view text = line->text;
    const size_t first = text.find_first_not_of(" \t\r");
    if (first == text.npos || text[first] == '#') continue;
    const TimeLine parsed = ParseTimeLine(text);
    const std::string place = absl::StrCat(path, ":", line->number, ": ");
    const bool may_be_heading = std::exchange(is_first, false);
    if (line->too_long || !parsed.time_ns) {
      const bool has_digit = std::any_of(text.begin(), text.end(), IsDigit);
      if (may_be_heading && !has_digit && !line->too_long) continue;
      times.refused.Add("", RefusalReason::kTimestampBadLine, 1,
                        absl::StrCat(place, "no whole number of ns behind the last ';'"));
      if (parsed.name.empty()) times.by_number.emplace_back();
      continue;
    }
    if (parsed.name.empty()) {
      times.by_number.push_back(parsed.time_ns);
    } else if (!times.by_name.emplace(parsed.name, *parsed.time_ns).second) {
      times.refused.Add("", RefusalReason::kTimestampDuplicate, 1,
                        absl::StrCat(place, parsed.name, " is there again"));
    }
  }
}

int64_t MedianStepNs(const std::vector<int64_t>& times_ns) {
  if (times_ns.size() < 2) return 0;
  std::vector<int64_t> steps;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    // Unsigned, because damaged times may be as far apart as 64 bits reach.
    const auto step = static_cast<uint64_t>(times_ns[i]) - static_cast<uint64_t>(times_ns[i - 1]);
    steps.push_back(static_cast<int64_t>(step));
  }
  return UpperMedian(&steps);
}

}  // namespace rigcal::agent
