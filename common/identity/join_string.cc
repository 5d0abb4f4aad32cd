// SPDX-License-Identifier: Apache-2.0
#include "common/identity/join_string.h"

#include <zlib.h>

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/status/validate_name.h"

namespace rigcal {
namespace {

constexpr std::string_view kPrefix = "rk1.";
constexpr size_t kHashBytes = 32;
constexpr size_t kCrcBytes = 4;
constexpr size_t kMaxTextBytes = 8192;
constexpr size_t kMaxHostBytes = 253;  // of a DNS name

void PutNumber(uint64_t value, int bytes, std::string* out) {
  for (int i = bytes - 1; i >= 0; --i) out->push_back(static_cast<char>(value >> (8 * i)));
}

void PutText(std::string_view text, std::string* out) {
  out->push_back(static_cast<char>(text.size()));
  out->append(text);
}

uint32_t CrcOf(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

// Takes bytes from the front; `ok` stays false once there were too few.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}

  bool ok() const { return ok_; }
  bool at_end() const { return bytes_.empty(); }
  std::string_view Bytes(size_t count) {
    if (count > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return {};
    }
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }
  uint64_t Number(size_t count) {
    uint64_t value = 0;
    for (const char byte : Bytes(count)) value = value << 8 | static_cast<uint8_t>(byte);
    return value;
  }
  std::string Text() { return std::string(Bytes(Number(1))); }

 private:
  std::string_view bytes_;
  bool ok_ = true;
};

absl::Status Damaged() {
  return absl::InvalidArgumentError(
      "the join string has a typo: its check digits do not fit, so a character is wrong or "
      "missing. "
      "Copy the whole string, from rk1. to its last character");
}

// The fields; false: they are not as JoinString says.
bool ReadFields(std::string_view bytes, JoinString* join) {
  ByteReader reader(bytes);
  join->role = static_cast<Role>(reader.Number(1));
  const uint64_t expiry_s = reader.Number(8);
  join->ca_sha256 = std::string(reader.Bytes(kHashBytes));
  join->secret = std::string(reader.Bytes(kJoinSecretBytes));
  join->name = reader.Text();
  join->grpc_port = static_cast<uint16_t>(reader.Number(2));
  join->https_port = static_cast<uint16_t>(reader.Number(2));
  const uint64_t hosts = reader.Number(1);
  if (hosts == 0 || hosts > kMaxJoinHosts) return false;
  for (uint64_t i = 0; i < hosts; ++i) join->hosts.push_back(reader.Text());
  constexpr uint64_t kYear9999 = 253'402'300'799;
  join->expiry = absl::FromUnixSeconds(static_cast<int64_t>(std::min(expiry_s, kYear9999)));
  return reader.ok() && reader.at_end() && expiry_s <= kYear9999 &&
         RoleName(join->role) != "unknown" && join->grpc_port > 0 && join->https_port > 0 &&
         (join->name.empty() || ValidateName("name", join->name).ok()) &&
         std::ranges::all_of(join->hosts, IsHostText);
}

}  // namespace

std::string FormatJoinString(const JoinString& join) {
  std::string bytes;
  PutNumber(static_cast<uint64_t>(join.role), 1, &bytes);
  PutNumber(static_cast<uint64_t>(absl::ToUnixSeconds(join.expiry)), 8, &bytes);
  absl::StrAppend(&bytes, join.ca_sha256, join.secret);
  PutText(join.name, &bytes);
  PutNumber(join.grpc_port, 2, &bytes);
  PutNumber(join.https_port, 2, &bytes);
  PutNumber(join.hosts.size(), 1, &bytes);
  for (const std::string& host : join.hosts) PutText(host, &bytes);
  PutNumber(CrcOf(bytes), kCrcBytes, &bytes);
  return absl::StrCat(std::string(kPrefix), absl::WebSafeBase64Escape(bytes));
}

absl::StatusOr<JoinString> ParseJoinString(std::string_view text) {
  const std::string trimmed(
      absl::StripAsciiWhitespace(absl::string_view(text.data(), text.size())));
  if (trimmed.size() > kMaxTextBytes || trimmed.size() < 4 || trimmed.substr(0, 2) != "rk" ||
      trimmed[3] != '.') {
    return absl::InvalidArgumentError(absl::StrCat(
        "not a join string: one begins with \"rk1.\" and is printed by rigcal token create",
        trimmed.rfind("https://", 0) == 0
            ? "; this is the address of a page for browsers, and the same command prints the "
              "string beside it"
            : ""));
  }
  if (trimmed.substr(0, kPrefix.size()) != kPrefix) {
    return absl::InvalidArgumentError(
        "the join string was made by another version of rigcal; install the server's version here");
  }
  const std::string encoded = trimmed.substr(kPrefix.size());
  std::string bytes;
  // The second condition: one way to write each string.
  if (!absl::WebSafeBase64Unescape(encoded, &bytes) ||
      absl::WebSafeBase64Escape(bytes) != encoded || bytes.size() < kCrcBytes) {
    return Damaged();
  }
  const std::string_view checked = std::string_view(bytes).substr(0, bytes.size() - kCrcBytes);
  if (ByteReader(std::string_view(bytes).substr(checked.size())).Number(kCrcBytes) !=
      CrcOf(checked)) {
    return Damaged();
  }
  JoinString join;
  if (!ReadFields(checked, &join)) {
    return absl::InvalidArgumentError(
        "the join string holds what no rigcal server writes into it; make another one with rigcal "
        "token create");
  }
  return join;
}

bool IsHostText(std::string_view host) {
  const auto allowed = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == ':';
  };
  return !host.empty() && host.size() <= kMaxHostBytes && std::ranges::all_of(host, allowed);
}

std::string JoinHostPort(std::string_view host, uint16_t port) {
  const bool is_ipv6 = host.find(':') != std::string_view::npos;
  return absl::StrCat(is_ipv6 ? "[" : "", std::string(host), is_ipv6 ? "]:" : ":", port);
}

std::vector<std::string> HostPorts(const std::vector<std::string>& hosts, uint16_t port) {
  std::vector<std::string> addresses;
  for (const std::string& host : hosts) addresses.push_back(JoinHostPort(host, port));
  return addresses;
}

bool SplitHostPort(std::string_view address, std::string* host, uint16_t* port) {
  const size_t colon = address.rfind(':');
  uint32_t number = 0;
  if (colon == std::string_view::npos || colon == 0 ||
      !absl::SimpleAtoi(std::string(address.substr(colon + 1)), &number) || number > 65535) {
    return false;
  }
  std::string_view name = address.substr(0, colon);
  if (name.size() > 2 && name.front() == '[' && name.back() == ']') {
    name = name.substr(1, name.size() - 2);
  }
  *host = std::string(name);
  *port = static_cast<uint16_t>(number);
  return true;
}

}  // namespace rigcal
