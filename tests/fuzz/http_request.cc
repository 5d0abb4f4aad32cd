// SPDX-License-Identifier: Apache-2.0
// What the HTTPS port reads from a client behind TLS: requests, one after the other, and their
// routes. The first byte is the size of the pieces in which the bytes arrive.
//
// @TOKEN@ stands for the secret of a join string, which is another one in each run.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <cstdint>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_replace.h"
#include "common/identity/join_string.h"
#include "server/http/http_messages.h"
#include "server/http/identity_routes.h"
#include "server/identity/server_identity.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"

namespace {

namespace http = boost::beast::http;
using ::rigcal::server::BeastResponse;
using ::rigcal::server::HttpServerOptions;
using ErrorCode = boost::system::error_code;

// Bytes that arrive in pieces, as Beast reads them.
class PieceStream {
 public:
  PieceStream(std::string bytes, size_t piece) : bytes_(std::move(bytes)), piece_(piece) {}

  template <typename Buffers>
  size_t read_some(const Buffers& buffers, ErrorCode& error) {
    const size_t count = boost::asio::buffer_copy(
        buffers, boost::asio::buffer(bytes_.data() + read_, bytes_.size() - read_), piece_);
    error = count == 0 ? ErrorCode(boost::asio::error::eof) : ErrorCode();
    read_ += count;
    return count;
  }
  template <typename Buffers>
  size_t read_some(const Buffers& buffers) {
    ErrorCode error;
    return read_some(buffers, error);
  }

 private:
  const std::string bytes_;
  const size_t piece_;
  size_t read_ = 0;
};

// A server's identity and its routes, made once.
struct Routes {
  Routes() {
    spdlog::set_level(spdlog::level::off);
    FUZZ_CHECK(rigcal::server::EnsureServerIdentity(folder.path(), {"server"}).ok());
    auto opened =
        rigcal::server::IdentityAuthority::Open(rigcal::server::IdentityDirectory(folder.path()));
    FUZZ_CHECK(opened.ok());
    authority = *std::move(opened);
    authority->SetAddresses({.hosts = {"server"}, .grpc_port = 7420, .https_port = 7421});
    const auto made = authority->CreateToken(rigcal::Role::kViewer, absl::Hours(24), "");
    FUZZ_CHECK(made.ok());
    secret = absl::WebSafeBase64Escape(rigcal::ParseJoinString(made->join_string)->secret);
    list = rigcal::server::IdentityRoutes(
        authority.get(), nullptr, [] { return absl::UnavailableError("the disk is full"); });
  }

  rigcal::testing::FuzzFolder folder;
  std::unique_ptr<rigcal::server::IdentityAuthority> authority;
  std::string secret;
  std::vector<rigcal::server::HttpRoute> list;
};

// What a client reads is what was meant, and nothing of a request gets into the header.
void CheckResponse(const BeastResponse& response) {
  static const std::set<unsigned> documented = {200, 400, 401, 403, 404, 405, 409, 413, 431, 503};
  FUZZ_CHECK(documented.count(response.result_int()) == 1);
  FUZZ_CHECK(response.body().size() < 64 << 10);
  std::ostringstream text;
  text << response;
  http::response_parser<http::string_body> parser;
  ErrorCode error;
  parser.eager(true);
  const std::string bytes = text.str();
  const size_t used = parser.put(boost::asio::buffer(bytes), error);
  FUZZ_CHECK(!error && parser.is_done() && used == bytes.size());
  FUZZ_CHECK(parser.get().result() == response.result());
  FUZZ_CHECK(parser.get().body() == response.body());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Routes routes;
  if (size == 0) return 0;
  std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  PieceStream stream(absl::StrReplaceAll(text, {{"@TOKEN@", routes.secret}}),
                     std::max<size_t>(data[0], 1));
  const HttpServerOptions options;
  boost::beast::flat_buffer buffer(options.max_header_bytes + options.max_body_bytes);
  bool keep_alive = true;
  while (keep_alive) {
    rigcal::server::HttpRequestParser parser;
    rigcal::server::SetLimits(options, &parser);
    ErrorCode error;
    http::read(stream, buffer, parser, error);
    const auto response = rigcal::server::AnswerTo(parser, error, "127.0.0.1", routes.list);
    if (!response) break;
    CheckResponse(*response);
    keep_alive = response->keep_alive();
    FUZZ_CHECK(!error || !keep_alive);
  }
  return 0;
}
