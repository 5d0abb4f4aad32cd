// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <cstring>
#include <list>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/identity/join_string.h"
#include "common/status/status_macros.h"
#include "server/http/http_messages.h"
#include "server/http/tls_context.h"
#include "server/listen/listen_socket.h"

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

asio::ip::address PlainAddress(const asio::ip::address& address) {
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
}

// What a limit per address counts.
std::string GroupOf(const tcp::endpoint& endpoint) {
  sockaddr_storage storage{};
  std::memcpy(&storage, endpoint.data(), std::min(endpoint.size(), sizeof storage));
  return AddressGroup(storage);
}

// The threads' work. Whoever makes an answer keeps it until that is made.
struct Runtime : std::enable_shared_from_this<Runtime> {
  explicit Runtime(size_t threads) : pool(threads) {}

  asio::io_context io{1};
  asio::thread_pool pool;
};

// Where a request waits for its answer. Only the thread of the sockets uses it.
struct Slot {
  asio::steady_timer* ready = nullptr;  // null: nobody waits any more
  std::optional<HttpResponse> response;
};

// On a thread of the pool.
void Begin(Runtime* runtime, const HttpRoute& route, HttpRequest request,
           const std::shared_ptr<Slot>& slot) {
  HttpRequest head = request;
  head.body.clear();
  const auto finish = [runtime = runtime->shared_from_this(), slot,
                       head = std::move(head)](HttpWork work) {
    asio::post(runtime->pool, [runtime = runtime.get(), slot, head, work = std::move(work)] {
      HttpResponse response = Handled(work);
      Compress(head, &response);
      asio::post(runtime->io, [slot, response = std::move(response)]() mutable {
        slot->response = std::move(response);
        if (slot->ready != nullptr) slot->ready->cancel();
      });
    });
  };
  try {
    route.begin(std::move(request), finish);
  } catch (const std::exception& error) {
    spdlog::error("HTTP {}: an unexpected fault: {}", route.path, error.what());
    finish([] { return ErrorResponse(absl::InternalError("an unexpected fault")); });
  }
}

}  // namespace

class HttpServer::Impl {
 public:
  Impl(HttpServerOptions options, HttpRouter router)
      : options_(std::move(options)),
        router_(std::move(router)),
        runtime_(std::make_shared<Runtime>(options_.worker_threads)) {}
  ~Impl() { Shutdown(); }

  absl::StatusOr<int> Start() {
    if (!options_.certificate_file.empty()) {
      RIGCAL_ASSIGN_OR_RETURN(context_,
                              MakeTlsContext(options_.certificate_file, options_.key_file));
    }
    std::string host;
    uint16_t port = 0;
    if (!SplitHostPort(options_.listen_address, &host, &port)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the HTTP address '", options_.listen_address, "' is not HOST:PORT"));
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
      return absl::UnavailableError(
          absl::StrCat("cannot listen on ", options_.listen_address, " for HTTP: ", error.message(),
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
    runtime_->pool.stop();
    runtime_->pool.join();
  }

  HttpStats Stats() const {
    return {.open_connections = open_,
            .accepted_connections = accepted_,
            .dropped_connections = dropped_,
            .requests = requests_,
            .refused_requests = refused_};
  }

 private:
  struct Connection {
    beast::tcp_stream* socket = nullptr;  // null: it ends
    std::string group;
    bool answering = false;
    bool has_asked = false;  // for anything that was answered
  };
  using Connections = std::list<Connection>;  // the one that was heard last at the end

  void Run() {
    while (!io_.stopped()) {
      try {
        io_.run();
      } catch (const std::exception& error) {
        spdlog::error("HTTP: an unexpected fault: {}", error.what());
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
        MakeRoom("");
        pause.expires_after(kAcceptPause);
        co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, error));
        continue;
      }
      ++accepted_;
      const tcp::endpoint from = socket.remote_endpoint(error);
      if (error) continue;  // gone already
      const std::string group = GroupOf(from);
      size_t from_there = 0;
      for (const Connection& connection : connections_) {
        if (connection.socket != nullptr && connection.group == group) ++from_there;
      }
      if (from_there >= options_.max_connections_per_address) MakeRoom(group);
      if (connections_.size() >= options_.max_connections) MakeRoom("");
      asio::co_spawn(io_, Serve(std::move(socket), group), asio::detached);
    }
  }

  // Drops a connection of this group; of any, for the empty one.
  void MakeRoom(const std::string& group) {
    Connection* choice = nullptr;
    for (Connection& connection : connections_) {
      if (connection.socket == nullptr || connection.answering) continue;
      if (!group.empty() && connection.group != group) continue;
      if (choice == nullptr || (choice->has_asked && !connection.has_asked)) choice = &connection;
    }
    if (choice == nullptr) return;
    // Its coroutine ends with an error, and takes it out of the list.
    choice->socket->close();
    choice->socket = nullptr;
    ++dropped_;
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
        spdlog::error("HTTP: an unexpected fault: {}", fault.what());
      }
      if (context_ == nullptr) continue;
      if (auto context = MakeTlsContext(options_.certificate_file, options_.key_file);
          context.ok()) {
        context_ = *std::move(context);  // for new connections
      } else {
        spdlog::error("HTTPS keeps its old certificate: {}",
                      std::string(context.status().message()));
      }
    }
  }

  asio::awaitable<void> Serve(tcp::socket socket, std::string group) {
    const auto connection = connections_.insert(connections_.end(), {.group = std::move(group)});
    open_ = connections_.size();
    try {
      co_await Converse(std::move(socket), connection);
    } catch (const std::exception& error) {
      spdlog::debug("HTTP: a connection ends: {}", error.what());
    }
    connections_.erase(connection);
    open_ = connections_.size();
  }

  // Plain or with TLS, as the first byte says.
  asio::awaitable<void> Converse(tcp::socket accepted, Connections::iterator connection) {
    ErrorCode error;
    const asio::ip::address address = PlainAddress(accepted.remote_endpoint(error).address());
    HttpOrigin origin{.peer = address.to_string()};
    beast::tcp_stream socket(std::move(accepted));
    connection->socket = &socket;
    beast::flat_buffer buffer(options_.max_header_bytes + options_.max_body_bytes);
    socket.expires_after(options_.request_timeout);
    const std::shared_ptr<asio::ssl::context> context = context_;
    origin.tls = co_await beast::async_detect_ssl(socket, buffer,
                                                  asio::redirect_error(asio::use_awaitable, error));
    if (error || connection->socket == nullptr || (origin.tls && context == nullptr)) {
      connection->socket = nullptr;
      co_return;
    }
    if (!origin.tls) {
      origin.local = options_.plain_loopback && address.is_loopback();
      co_await Answer(socket, buffer, connection, origin);
      connection->socket = nullptr;
      socket.socket().shutdown(tcp::socket::shutdown_send, error);
      co_return;
    }
    TlsStream stream(std::move(socket), *context);
    connection->socket = &beast::get_lowest_layer(stream);
    connection->socket->expires_after(options_.request_timeout);
    const size_t used = co_await stream.async_handshake(asio::ssl::stream_base::server,
                                                        buffer.data(), asio::use_awaitable);
    buffer.consume(used);
    co_await Answer(stream, buffer, connection, origin);
    connection->socket = nullptr;
    beast::get_lowest_layer(stream).expires_after(kLinger);
    co_await stream.async_shutdown(asio::use_awaitable);
  }

  // One request after the other.
  template <typename Stream>
  asio::awaitable<void> Answer(Stream& stream, beast::flat_buffer& buffer,
                               Connections::iterator connection, const HttpOrigin& origin) {
    auto& socket = beast::get_lowest_layer(stream);
    bool keep_alive = true;
    while (keep_alive) {
      ErrorCode error;
      HttpRequestParser parser;
      SetLimits(options_, &parser);
      socket.expires_after(options_.request_timeout);
      co_await http::async_read_header(stream, buffer, parser,
                                       asio::redirect_error(asio::use_awaitable, error));
      HttpRequest request{.peer = origin.peer};
      HttpRouter::Admission admission;
      std::optional<HttpResponse> response;
      if (!error) {
        request = RequestOf(parser, origin);
        admission = router_.Admit(&request);
        response = std::move(admission.refusal);
        if (!response) response = LimitBody(*admission.route, &parser);
      }
      bool body_read = parser.is_done();
      if (!error && !response && !body_read) {
        if (parser.get()[http::field::expect] == "100-continue") {
          http::response<http::empty_body> go_on(http::status::continue_, 11);
          co_await http::async_write(stream, go_on, asio::use_awaitable);
        }
        co_await http::async_read(stream, buffer, parser,
                                  asio::redirect_error(asio::use_awaitable, error));
        body_read = !error;
      }
      if (error) {
        response = AnswerToFault(error);
        if (!response) co_return;
      }
      connection->answering = true;
      if (!response) {
        request.body = std::move(parser.get().body());
        response = co_await AnswerOf(*admission.route, request);
      }
      ++requests_;
      if (response->status >= 400) ++refused_;
      keep_alive = body_read && parser.get().keep_alive();
      const unsigned status = response->status;
      const BeastResponse message = ToBeast(request, *std::move(response), keep_alive);
      socket.expires_after(options_.request_timeout);
      co_await http::async_write(stream, message, asio::use_awaitable);
      connection->answering = false;
      connection->has_asked = true;
      connections_.splice(connections_.end(), connections_, connection);
      if (!body_read && status != 400) co_await Linger(stream);
    }
  }

  asio::awaitable<HttpResponse> AnswerOf(const HttpRoute& route, HttpRequest& request) {
    if (!route.begin) {
      HttpResponse response = Handled([&] { return route.handle(request); });
      Compress(request, &response);
      co_return response;
    }
    if (calls_ >= options_.max_calls) {
      co_return ErrorResponse(absl::ResourceExhaustedError(absl::StrCat(
          "this server answers ", calls_, " requests already; try again in a moment")));
    }
    ++calls_;
    const auto slot = std::make_shared<Slot>();
    asio::steady_timer ready(io_, options_.answer_timeout);
    slot->ready = &ready;
    asio::post(runtime_->pool, [runtime = runtime_.get(), &route, request, slot] {
      Begin(runtime, route, request, slot);
    });
    ErrorCode ignored;
    co_await ready.async_wait(asio::redirect_error(asio::use_awaitable, ignored));
    slot->ready = nullptr;
    --calls_;
    if (slot->response) co_return *std::move(slot->response);
    co_return ErrorResponse(absl::DeadlineExceededError("there was no answer in time"));
  }

  template <typename Stream>
  asio::awaitable<void> Linger(Stream& stream) {
    auto& socket = beast::get_lowest_layer(stream);
    socket.expires_after(kLinger);
    std::vector<char> bytes(size_t{16} << 10);
    for (size_t read = 0; read < kLingerBytes;) {
      read += co_await stream.async_read_some(asio::buffer(bytes), asio::use_awaitable);
    }
  }

  const HttpServerOptions options_;
  const HttpRouter router_;
  std::atomic<size_t> open_ = 0;
  std::atomic<uint64_t> accepted_ = 0;
  std::atomic<uint64_t> dropped_ = 0;
  std::atomic<uint64_t> requests_ = 0;
  std::atomic<uint64_t> refused_ = 0;
  // Only the thread uses what follows, once it runs. Coroutines that are left over go with the
  // runtime, and use what is before it.
  std::shared_ptr<asio::ssl::context> context_;
  Connections connections_;
  size_t calls_ = 0;
  const std::shared_ptr<Runtime> runtime_;
  asio::io_context& io_ = runtime_->io;
  tcp::acceptor acceptor_{io_};
  std::thread thread_;
};

HttpServer::HttpServer(HttpServerOptions options, HttpRouter router)
    : impl_(std::make_unique<Impl>(std::move(options), std::move(router))) {}
HttpServer::~HttpServer() = default;
absl::StatusOr<int> HttpServer::Start() { return impl_->Start(); }
void HttpServer::Shutdown() { impl_->Shutdown(); }
HttpStats HttpServer::Stats() const { return impl_->Stats(); }

}  // namespace rigcal::server
