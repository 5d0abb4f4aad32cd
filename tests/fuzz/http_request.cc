// SPDX-License-Identifier: Apache-2.0
// What the HTTP port reads from a client, behind TLS or not: requests, one after the other, and
// their routes, those of the JSON API too. The first byte is the size of the pieces in which the
// bytes arrive; it also says whether they came over TLS (odd), from this machine, or from elsewhere
// (2).
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
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_replace.h"
#include "common/identity/join_string.h"
#include "server/api/api_routes.h"
#include "server/http/api_handler.h"
#include "server/http/asset_routes.h"
#include "server/http/http_messages.h"
#include "server/http/http_router.h"
#include "server/http/identity_routes.h"
#include "server/http/login_routes.h"
#include "server/identity/server_identity.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"

namespace {

namespace http = boost::beast::http;
using ::rigcal::server::BeastResponse;
using ::rigcal::server::HttpRequest;
using ::rigcal::server::HttpResponse;
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

// Answers each call with what it was asked.
class EchoGateway final : public rigcal::server::ApiGateway {
 public:
  void Call(rigcal::server::ApiRequest request, std::function<void(Work)> done) override {
    FUZZ_CHECK(request.route != nullptr);
    FUZZ_CHECK(request.variables.size() == rigcal::server::VariablesOf(request.route->path).size());
    for (const auto& list : {request.variables, request.parameters}) {
      for (const auto& [name, value] : list) {
        FUZZ_CHECK(std::ranges::none_of(name + value, [](unsigned char c) { return c < 0x20; }));
      }
    }
    auto body = std::make_shared<rigcal::server::ApiBody>();
    body->text = request.body;
    done([body, etag = request.known_etag] {
      return rigcal::server::ApiAnswer{.body = body, .etag = etag};
    });
  }
  absl::Status Check(const rigcal::server::Peer&, std::string_view) override {
    return absl::OkStatus();
  }
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
    std::vector<rigcal::server::HttpRoute> list = rigcal::server::IdentityRoutes(
        authority.get(), nullptr, [] { return absl::UnavailableError("the disk is full"); });
    for (auto& more : {rigcal::server::LoginRoutes(authority.get(), nullptr),
                       rigcal::server::AssetRoutes({}), rigcal::server::ApiHttpRoutes(&gateway)}) {
      list.insert(list.end(), more.begin(), more.end());
    }
    router = std::make_unique<rigcal::server::HttpRouter>(
        std::move(list),
        rigcal::server::HttpGuards{
            .is_own_host = [](const std::string& host) { return host == "server"; },
            .identify =
                [this](const rigcal::server::HttpRequest& request) {
                  return rigcal::server::CallerOf(authority.get(), request);
                }});
  }

  rigcal::testing::FuzzFolder folder;
  std::unique_ptr<rigcal::server::IdentityAuthority> authority;
  std::string secret;
  EchoGateway gateway;
  std::unique_ptr<rigcal::server::HttpRouter> router;
};

// What a client reads is what was meant, and nothing of a request gets into the header.
void CheckResponse(const BeastResponse& response, bool is_head) {
  static const std::set<unsigned> documented = {200, 304, 308, 400, 401, 403,
                                                404, 405, 409, 413, 431, 503};
  FUZZ_CHECK(documented.count(response.result_int()) == 1);
  FUZZ_CHECK(response.body().size() < 2 << 20);
  FUZZ_CHECK(response.count("Access-Control-Allow-Origin") == 0);
  std::ostringstream text;
  text << response;
  http::response_parser<http::string_body> parser;
  ErrorCode error;
  parser.eager(true);
  parser.skip(is_head);
  const std::string bytes = text.str();
  const size_t used = parser.put(boost::asio::buffer(bytes), error);
  FUZZ_CHECK(!error && parser.is_done() && used == bytes.size());
  FUZZ_CHECK(parser.get().result() == response.result());
  FUZZ_CHECK(parser.get().body() == response.body());
}

// What the server does with a request, without its threads.
HttpResponse AnswerOf(const rigcal::server::HttpRoute& route, const HttpRequest& request) {
  if (!route.begin) return rigcal::server::Handled([&] { return route.handle(request); });
  std::optional<HttpResponse> response;
  route.begin(request, [&](const rigcal::server::HttpWork& work) {
    FUZZ_CHECK(!response.has_value());
    response = rigcal::server::Handled(work);
  });
  FUZZ_CHECK(response.has_value());
  return *response;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Routes routes;
  if (size == 0) return 0;
  std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  PieceStream stream(absl::StrReplaceAll(text, {{"@TOKEN@", routes.secret}}),
                     std::max<size_t>(data[0], 1));
  // Over TLS, from this machine, or from elsewhere.
  const rigcal::server::HttpOrigin origin{
      .peer = "127.0.0.1", .tls = data[0] % 2 == 1, .local = data[0] % 2 == 0 && data[0] != 2};
  const HttpServerOptions options;
  boost::beast::flat_buffer buffer(options.max_header_bytes + options.max_body_bytes);
  bool keep_alive = true;
  while (keep_alive) {
    rigcal::server::HttpRequestParser parser;
    rigcal::server::SetLimits(options, &parser);
    ErrorCode error;
    HttpRequest request{.peer = origin.peer};
    rigcal::server::HttpRouter::Admission admission;
    std::optional<HttpResponse> response;
    http::read_header(stream, buffer, parser, error);
    if (!error) {
      request = rigcal::server::RequestOf(parser, origin);
      admission = routes.router->Admit(&request);
      response = std::move(admission.refusal);
      if (!response) response = rigcal::server::LimitBody(*admission.route, &parser);
    }
    if (!error && !response && !parser.is_done()) http::read(stream, buffer, parser, error);
    const bool body_read = !error && parser.is_done();
    if (error) response = rigcal::server::AnswerToFault(error);
    if (error && !response) break;
    if (!response) {
      request.body = std::move(parser.get().body());
      FUZZ_CHECK(request.body.size() <= admission.route->max_body_bytes);
      response = AnswerOf(*admission.route, request);
    }
    rigcal::server::Compress(request, &*response);
    keep_alive = body_read && parser.get().keep_alive();
    CheckResponse(rigcal::server::ToBeast(request, *std::move(response), keep_alive),
                  request.method == "HEAD");
  }
  return 0;
}
