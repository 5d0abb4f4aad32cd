// SPDX-License-Identifier: Apache-2.0
#include "tests/server/http/join_fixture.h"

#include <arpa/inet.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <utility>

#include "common/identity/openssl_handles.h"
#include "server/http/identity_routes.h"
#include "server/identity/server_identity.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {

void JoinFixture::StartServer(absl::Duration ahead, const std::string& host) {
  signal(SIGPIPE, SIG_IGN);  // of the impostors of these tests
  http_.reset();
  ahead_ = ahead;
  ASSERT_THAT(server::EnsureServerIdentity(data_.path(), {host}, Now()), IsOk());
  auto opened = server::IdentityAuthority::Open(folder(), [this] { return Now(); });
  ASSERT_THAT(opened, IsOk());
  authority_ = *std::move(opened);
  http_options_.listen_address = "127.0.0.1:0";
  http_options_.certificate_file = folder() / "server.crt";
  http_options_.key_file = folder() / "server.key";
  http_ = std::make_unique<server::HttpServer>(
      http_options_, server::IdentityRoutes(authority_.get(), nullptr, [this] { return ready_; }));
  ASSERT_OK_AND_ASSIGN(port_, http_->Start());
  authority_->SetAddresses(
      {.hosts = {host}, .grpc_port = 7420, .https_port = static_cast<uint16_t>(port_)});
}

rigcal::JoinString JoinFixture::MakeJoin(Role role, const std::string& name, absl::Duration ttl) {
  const auto made = authority_->CreateToken(role, ttl, name);
  EXPECT_THAT(made, IsOk());
  return *ParseJoinString(made->join_string);
}

void OneShotListener::Listen(std::function<void(int)> serve) {
  fd_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), size), 0);
  EXPECT_EQ(listen(fd_, 8), 0);
  EXPECT_EQ(getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size), 0);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this, serve = std::move(serve)] {
    for (int client = 0; (client = accept(fd_, nullptr, nullptr)) >= 0;) {
      serve(client);
      close(client);
    }
  });
}

OneShotListener::OneShotListener(std::string greeting) {
  Listen([greeting = std::move(greeting)](int client) {
    send(client, greeting.data(), greeting.size(), MSG_NOSIGNAL);
    char bytes[2048];
    // What came is taken: else closing would reset the connection.
    (void)!recv(client, bytes, sizeof bytes, 0);
  });
}

OneShotListener::OneShotListener(const std::string& certificate_pem, const std::string& key_pem,
                                 const std::string& client_ca_pem) {
  const std::shared_ptr<SSL_CTX> context(SSL_CTX_new(TLS_server_method()), SSL_CTX_free);
  const openssl::CertificatePtr certificate = openssl::CertificateFromPem(certificate_pem);
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(key_pem);
  const openssl::CertificatePtr ca = openssl::CertificateFromPem(client_ca_pem);
  EXPECT_EQ(SSL_CTX_use_certificate(context.get(), certificate.get()), 1);
  EXPECT_EQ(SSL_CTX_use_PrivateKey(context.get(), key.get()), 1);
  EXPECT_EQ(X509_STORE_add_cert(SSL_CTX_get_cert_store(context.get()), ca.get()), 1);
  SSL_CTX_set_verify(context.get(), SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  Listen([context](int client) {
    const std::unique_ptr<SSL, openssl::Deleter<SSL_free>> ssl(SSL_new(context.get()));
    SSL_set_fd(ssl.get(), client);
    if (SSL_accept(ssl.get()) == 1) SSL_write(ssl.get(), "x", 1);
    ERR_clear_error();
  });
}

OneShotListener::~OneShotListener() {
  shutdown(fd_, SHUT_RDWR);
  thread_.join();
  close(fd_);
}

RawSocket::RawSocket(int port) : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  connected_ = connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

RawSocket::~RawSocket() { close(fd_); }

void RawSocket::Send(absl::string_view bytes) const {
  while (!bytes.empty()) {
    const ssize_t sent = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return;
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
}

std::string RawSocket::ReadToEnd(int limit_s, bool* closed) const {
  const timeval limit = {.tv_sec = limit_s, .tv_usec = 0};
  setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  std::string text;
  char bytes[4096];
  while (true) {
    const ssize_t got = recv(fd_, bytes, sizeof bytes, 0);
    if (got > 0) {
      text.append(bytes, static_cast<size_t>(got));
      continue;
    }
    if (closed != nullptr) *closed = got == 0 || errno == ECONNRESET;
    return text;
  }
}

std::string SendOverTls(int port, const std::string& bytes) {
  const std::unique_ptr<SSL_CTX, openssl::Deleter<SSL_CTX_free>> context(
      SSL_CTX_new(TLS_client_method()));
  const openssl::BioPtr bio(BIO_new_ssl_connect(context.get()));
  BIO_set_conn_hostname(bio.get(), ("127.0.0.1:" + std::to_string(port)).c_str());
  if (BIO_do_connect(bio.get()) != 1) return "cannot connect";
  size_t sent = 0;
  while (sent < bytes.size()) {
    const int now = BIO_write(bio.get(), bytes.data() + sent,
                              static_cast<int>(std::min<size_t>(bytes.size() - sent, 16384)));
    if (now <= 0) break;
    sent += static_cast<size_t>(now);
  }
  std::string answer;
  char buffer[4096];
  for (int got = 0; (got = BIO_read(bio.get(), buffer, sizeof buffer)) > 0;) {
    answer.append(buffer, static_cast<size_t>(got));
  }
  ERR_clear_error();
  return answer;
}

}  // namespace rigcal::testing
