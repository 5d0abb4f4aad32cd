// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <spdlog/spdlog.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <list>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/identity/durable_file.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "server/http/http_messages.h"

namespace rigcal::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using ErrorCode = boost::system::error_code;

using TlsStream = beast::ssl_stream<beast::tcp_stream>;

// How long, and for how much, a client that sends too much is heard out: a connection that is
// closed earlier may lose the answer.
constexpr std::chrono::seconds kLinger{1};
constexpr size_t kLingerBytes = 4 << 20;
constexpr std::chrono::milliseconds kAcceptPause{100};

absl::StatusOr<std::shared_ptr<asio::ssl::context>> MakeContext(const HttpServerOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string certificate, ReadSmallFile(options.certificate_file));
  RIGCAL_ASSIGN_OR_RETURN(const std::string key, ReadSmallFile(options.key_file));
  RIGCAL_RETURN_IF_ERROR(CheckKeyOf(
      certificate, key,
      absl::StrCat(options.certificate_file.string(), " and ", options.key_file.string())));
  using Context = asio::ssl::context;
  auto context = std::make_shared<Context>(Context::tls_server);
  ErrorCode error;
  context->set_options(Context::default_workarounds | Context::no_sslv2 | Context::no_sslv3 |
                       Context::no_tlsv1 | Context::no_tlsv1_1);
  context->use_certificate_chain(asio::buffer(certificate), error);
  if (!error) context->use_private_key(asio::buffer(key), Context::pem, error);
  if (!error) return context;
  return absl::FailedPreconditionError(absl::StrCat(
      "cannot use ", options.certificate_file.string(), " for HTTPS: ", error.message()));
}

}  // namespace

class HttpServer::Impl {
 public:
  Impl(HttpServerOptions options, std::vector<HttpRoute> routes)
      : options_(std::move(options)), routes_(std::move(routes)) {}
  ~Impl() { Shutdown(); }

  absl::StatusOr<int> Start() {
    RIGCAL_ASSIGN_OR_RETURN(context_, MakeContext(options_));
    std::string host;
    uint16_t port = 0;
    if (!SplitHostPort(options_.listen_address, &host, &port)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the HTTPS address '", options_.listen_address, "' is not HOST:PORT"));
    }
    ErrorCode error;
    const auto found =
        tcp::resolver(io_).resolve(host, std::to_string(port), tcp::resolver::passive, error);
    if (!error && !found.empty()) {
      const tcp::endpoint endpoint = found.begin()->endpoint();
      acceptor_.open(endpoint.protocol(), error);
      if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
      if (!error) acceptor_.bind(endpoint, error);
      if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    }
    if (error || !acceptor_.is_open()) {
      return absl::UnavailableError(absl::StrCat(
          "cannot listen on ", options_.listen_address, " for HTTPS: ", error.message(),
          "; stop the program that uses the port, or choose another one: listen under "
          "[https] in the configuration"));
    }
    asio::co_spawn(io_, Accept(), asio::detached);
    asio::co_spawn(io_, Refresh(), asio::detached);
    thread_ = std::thread([this] { Run(); });
    return acceptor_.local_endpoint().port();
  }

  void Shutdown() {
    io_.stop();
    if (thread_.joinable()) thread_.join();
  }

 private:
  struct Connection {
    TlsStream* stream = nullptr;
    bool answering = false;
  };
  using Connections = std::list<Connection>;  // the one that was heard last at the end

  void Run() {
    while (!io_.stopped()) {
      try {
        io_.run();
      } catch (const std::exception& error) {
        spdlog::error("HTTPS: an unexpected fault: {}", error.what());
      }
    }
  }

  asio::awaitable<void> Accept() {
    asio::steady_timer pause(io_);
    while (true) {
      ErrorCode error;
      tcp::socket socket(io_);
      co_await acceptor_.async_accept(socket, asio::redirect_error(asio::use_awaitable, error));
      if (error == asio::error::operation_aborted) co_return;
      if (error) {
        // No descriptor is free, or the like: others may go meanwhile.
        MakeRoom();
        pause.expires_after(kAcceptPause);
        co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, error));
        continue;
      }
      if (connections_.size() >= options_.max_connections) MakeRoom();
      asio::co_spawn(io_, Serve(std::move(socket), context_), asio::detached);
    }
  }

  void MakeRoom() {
    for (Connection& connection : connections_) {
      if (connection.answering) continue;
      // Its coroutine ends with an error, and takes it out of the list.
      beast::get_lowest_layer(*connection.stream).close();
      connection.answering = true;
      return;
    }
  }

  asio::awaitable<void> Refresh() {
    asio::steady_timer timer(io_);
    while (true) {
      ErrorCode error;
      timer.expires_after(options_.refresh_interval);
      co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, error));
      try {
        options_.refresh();
      } catch (const std::exception& fault) {
        spdlog::error("HTTPS: an unexpected fault: {}", fault.what());
      }
      if (auto context = MakeContext(options_); context.ok()) {
        context_ = *std::move(context);  // for new connections
      } else {
        spdlog::error("HTTPS keeps its old certificate: {}",
                      std::string(context.status().message()));
      }
    }
  }

  asio::awaitable<void> Serve(tcp::socket socket, std::shared_ptr<asio::ssl::context> context) {
    TlsStream stream(std::move(socket), *context);
    const auto connection = connections_.insert(connections_.end(), {.stream = &stream});
    try {
      co_await Converse(stream, connection);
    } catch (const std::exception& error) {
      spdlog::debug("HTTPS: a connection ends: {}", error.what());
    }
    connections_.erase(connection);
  }

  asio::awaitable<void> Converse(TlsStream& stream, Connections::iterator connection) {
    auto& socket = beast::get_lowest_layer(stream);
    ErrorCode unknown;
    const std::string peer = socket.socket().remote_endpoint(unknown).address().to_string();
    socket.expires_after(options_.request_timeout);
    co_await stream.async_handshake(asio::ssl::stream_base::server, asio::use_awaitable);
    beast::flat_buffer buffer(options_.max_header_bytes + options_.max_body_bytes);
    bool keep_alive = true;
    while (keep_alive) {
      ErrorCode error;
      HttpRequestParser parser;
      SetLimits(options_, &parser);
      socket.expires_after(options_.request_timeout);
      co_await http::async_read(stream, buffer, parser,
                                asio::redirect_error(asio::use_awaitable, error));
      std::optional<BeastResponse> response = AnswerTo(parser, error, peer, routes_);
      if (!response) co_return;
      keep_alive = response->keep_alive();
      connection->answering = true;
      socket.expires_after(options_.request_timeout);
      co_await http::async_write(stream, *response, asio::use_awaitable);
      connection->answering = false;
      connections_.splice(connections_.end(), connections_, connection);
      if (error && response->result() != http::status::bad_request) co_await Linger(stream);
    }
    socket.expires_after(kLinger);
    co_await stream.async_shutdown(asio::use_awaitable);
  }

  asio::awaitable<void> Linger(TlsStream& stream) {
    auto& socket = beast::get_lowest_layer(stream);
    socket.expires_after(kLinger);
    std::vector<char> bytes(size_t{16} << 10);
    for (size_t read = 0; read < kLingerBytes;) {
      read += co_await stream.async_read_some(asio::buffer(bytes), asio::use_awaitable);
    }
  }

  const HttpServerOptions options_;
  const std::vector<HttpRoute> routes_;
  // Only the thread uses what follows, once it runs. Coroutines that are left over go with io_, and
  // use what is before it.
  std::shared_ptr<asio::ssl::context> context_;
  Connections connections_;
  asio::io_context io_{1};
  tcp::acceptor acceptor_{io_};
  std::thread thread_;
};

HttpServer::HttpServer(HttpServerOptions options, std::vector<HttpRoute> routes)
    : impl_(std::make_unique<Impl>(std::move(options), std::move(routes))) {}
HttpServer::~HttpServer() = default;
absl::StatusOr<int> HttpServer::Start() { return impl_->Start(); }
void HttpServer::Shutdown() { impl_->Shutdown(); }

}  // namespace rigcal::server
