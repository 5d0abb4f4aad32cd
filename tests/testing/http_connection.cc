// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/http_connection.h"

#include <cstdlib>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace rigcal::testing {

std::string HttpReply::Header(const std::string& name) const {
  for (size_t at = head.find("\r\n"); at != std::string::npos; at = head.find("\r\n", at + 2)) {
    const std::string line = head.substr(at + 2, head.find("\r\n", at + 2) - at - 2);
    if (absl::StartsWithIgnoreCase(line, name + ": ")) return line.substr(name.size() + 2);
  }
  return "";
}

absl::StatusOr<HttpReply> HttpConnection::Call(const std::string& method, const std::string& path,
                                               const std::string& headers,
                                               const std::string& body) {
  std::string request = absl::StrCat(method, " ", path, " HTTP/1.1\r\n", headers);
  if (!absl::StrContains(headers, "Host: ")) request += "Host: 127.0.0.1\r\n";
  if (!body.empty()) absl::StrAppend(&request, "Content-Length: ", body.size(), "\r\n");
  socket_.Send(request + "\r\n" + body);
  return Read(method != "HEAD");
}

absl::StatusOr<HttpReply> HttpConnection::Read(bool has_body) {
  const auto receive = [this] {
    const std::string bytes = socket_.Receive();
    received_ += bytes;
    return !bytes.empty();
  };
  size_t end = 0;
  while ((end = received_.find("\r\n\r\n")) == std::string::npos) {
    if (!receive()) return absl::UnavailableError("the connection ended before an answer");
  }
  HttpReply reply;
  reply.head = received_.substr(0, end);
  received_.erase(0, end + 4);
  if (reply.head.size() > 9) reply.status = std::atoi(reply.head.c_str() + 9);
  const size_t length = std::strtoul(reply.Header("Content-Length").c_str(), nullptr, 10);
  if (!has_body || reply.status == 304) return reply;
  while (received_.size() < length) {
    if (!receive()) return absl::UnavailableError("the connection ended within an answer");
  }
  reply.body = received_.substr(0, length);
  received_.erase(0, length);
  return reply;
}

}  // namespace rigcal::testing
