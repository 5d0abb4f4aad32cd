// SPDX-License-Identifier: Apache-2.0
// A join string: what is read must be written in the same way again, and no fault quotes what was
// given, which is a secret.
#include "common/identity/join_string.h"

#include <string>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "tests/fuzz/fuzz_check.h"

namespace {

void CheckJoinString(std::string_view text) {
  const auto join = rigcal::ParseJoinString(text);
  if (!join.ok()) {
    FUZZ_CHECK(join.status().code() == absl::StatusCode::kInvalidArgument);
    FUZZ_CHECK(join.status().message().size() < 300);
    return;
  }
  const std::string trimmed(
      absl::StripAsciiWhitespace(absl::string_view(text.data(), text.size())));
  FUZZ_CHECK(rigcal::FormatJoinString(*join) == trimmed);
  FUZZ_CHECK(join->ca_sha256.size() == 32 && join->secret.size() == rigcal::kJoinSecretBytes);
  FUZZ_CHECK(!join->hosts.empty() && join->hosts.size() <= rigcal::kMaxJoinHosts);
  for (const std::string& host : join->hosts) FUZZ_CHECK(rigcal::IsHostText(host));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  CheckJoinString(bytes);
  // As the bytes inside the string, which a random text never reaches.
  CheckJoinString("rk1." + absl::WebSafeBase64Escape(absl::string_view(bytes.data(), size)));
  std::string host;
  uint16_t port = 0;
  rigcal::SplitHostPort(bytes, &host, &port);
  return 0;
}
