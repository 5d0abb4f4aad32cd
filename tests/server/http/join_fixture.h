// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "common/identity/join_string.h"
#include "server/http/http_server.h"
#include "server/identity/identity_authority.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing {

// A server that others can join, on a real socket of this PC, with a clock of its own.
class JoinFixture : public ::testing::Test {
 protected:
  // `ahead`: of the server's clock, against that of this PC.
  void StartServer(absl::Duration ahead = absl::ZeroDuration(),
                   const std::string& host = "127.0.0.1");
  void StopServer() { http_.reset(); }

  absl::Time Now() const { return absl::Now() + ahead_; }
  std::filesystem::path folder() const { return data_.path() / "identity"; }
  server::IdentityAuthority& authority() { return *authority_; }
  int port() const { return port_; }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  // A join string of the server, taken apart.
  rigcal::JoinString MakeJoin(Role role = Role::kAgent, const std::string& name = "",
                              absl::Duration ttl = absl::Hours(1));

  server::HttpServerOptions http_options_;
  absl::Status ready_;

 private:
  TemporaryDirectory data_;
  absl::Duration ahead_;
  std::unique_ptr<server::IdentityAuthority> authority_;
  std::unique_ptr<server::HttpServer> http_;
  int port_ = 0;
};

// Takes one connection after the other on a port of this PC, and closes each after its first
// bytes.
class OneShotListener {
 public:
  // Sends these bytes without TLS.
  explicit OneShotListener(std::string greeting);
  // TLS with this certificate and key, for clients with a certificate of this CA only.
  OneShotListener(const std::string& certificate_pem, const std::string& key_pem,
                  const std::string& client_ca_pem);
  ~OneShotListener();
  OneShotListener(const OneShotListener&) = delete;
  OneShotListener& operator=(const OneShotListener&) = delete;

  int port() const { return port_; }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

 private:
  void Listen(std::function<void(int)> serve);

  int fd_ = -1;
  int port_ = 0;
  std::thread thread_;
};

// A connection without TLS to a port of this PC.
class RawSocket {
 public:
  explicit RawSocket(int port);
  ~RawSocket();
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  bool connected() const { return connected_; }
  void Send(absl::string_view bytes) const;
  // What comes until the other side closes, or until `limit_s`; `closed`: it did close.
  std::string ReadToEnd(int limit_s, bool* closed = nullptr) const;

 private:
  int fd_ = -1;
  bool connected_ = false;
};

// The answer to bytes sent over TLS; the server is not verified.
std::string SendOverTls(int port, const std::string& bytes);

}  // namespace rigcal::testing
