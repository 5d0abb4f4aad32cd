// SPDX-License-Identifier: Apache-2.0
// T11: what is no TLS, or an old one; and the socket file, which needs none.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>
#include <openssl/ssl.h>
#include <unistd.h>

#include <string>

#include "server/listen/listen_socket.h"
#include "tests/server/rpc/tls_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/raw_socket.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::tls_test {
namespace {

using ::testing::HasSubstr;

class Tls : public TlsFixture {
 protected:
  // The handshake of a client that knows TLS up to `version`; what the server answers with.
  std::string AnswerToHandshake(int version) {
    SSL_CTX* context = SSL_CTX_new(TLS_client_method());
    SSL_CTX_set_security_level(context, 0);
    SSL_CTX_set_min_proto_version(context, TLS1_VERSION);
    SSL_CTX_set_max_proto_version(context, version);
    SSL* tls = SSL_new(context);
    BIO* from_server = BIO_new(BIO_s_mem());
    BIO* to_server = BIO_new(BIO_s_mem());
    SSL_set_bio(tls, from_server, to_server);
    SSL_set_connect_state(tls);
    SSL_do_handshake(tls);
    char* data = nullptr;
    const long size = BIO_get_mem_data(to_server, &data);
    RawSocket socket(port_);
    socket.Send(std::string(data, static_cast<size_t>(size)));
    std::string answer = socket.Receive();
    SSL_free(tls);
    SSL_CTX_free(context);
    return answer;
  }
};

TEST_F(Tls, WhatIsNoTlsIsClosedAndOthersAreServed) {
  for (const std::string& bytes :
       {std::string("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"), std::string("GET / HTTP/1.1\r\n\r\n"),
        std::string("SSH-2.0-x\r\n"), std::string(100'000, '\xff'), std::string(1, '\0')}) {
    RawSocket socket(port_);
    socket.Send(bytes);
    EXPECT_TRUE(socket.AwaitEnd()) << bytes.substr(0, 10);
  }
  // TLS, and then nonsense or nothing: the handshake has 5 s.
  for (const std::string& bytes : {std::string("\x16\x03\x01\x02\x00", 5),
                                   "\x16" + std::string(5000, '\xff'), std::string("\x16")}) {
    RawSocket socket(port_);
    socket.Send(bytes);
    EXPECT_TRUE(socket.AwaitEnd());
  }
  EXPECT_TRUE(WaitFor([&] { return Audit().find("it is not TLS") != std::string::npos; }));
  EXPECT_THAT(ServerClient(UserChannel("viewer")).ListAgents(), IsOk());
}

TEST(AddressOfUri, IsAsTheListenerWritesIt) {
  EXPECT_EQ(server::AddressOfUri("ipv4:10.0.0.5:41002"), "10.0.0.5:41002");
  EXPECT_EQ(server::AddressOfUri("ipv6:%5B::1%5D:41002"), "[::1]:41002");
  EXPECT_EQ(server::AddressOfUri("unix:"), "");
  EXPECT_EQ(server::AddressOfUri("inproc"), "");
}

TEST_F(Tls, OverIpv6ARevokedPeerIsCutToo) {
  const absl::StatusOr<int> probe = server::ListenOn("[::1]:0");
  if (!probe.ok()) GTEST_SKIP() << "no IPv6 here: " << probe.status();
  close(*probe);
  rpc_options_.endpoint.listen_address = "[::1]:0";
  RestartServer();
  grpc::ChannelArguments arguments;
  const TestCertificate own = ca_.MakeAgent("pc1");
  const auto channel =
      grpc::CreateCustomChannel("[::1]:" + std::to_string(port_),
                                grpc::SslCredentials({.pem_root_certs = ca_.certificate_pem(),
                                                      .pem_private_key = own.key_pem,
                                                      .pem_cert_chain = own.certificate_pem}),
                                arguments);
  TestAgent agent(channel, MakeHello("pc1", {"left"}));
  agent.ReadHello();
  Deny("rigcal://agents/pc1");
  EXPECT_FALSE(agent.AwaitEnd().ok());
  EXPECT_TRUE(WaitFor([&] { return Audit().find("connection_cut") != std::string::npos; }));
}

TEST_F(Tls, OldVersionsAreRefused) {
  // An alert, where a server of that version would begin with its handshake (0x16).
  for (const int version : {TLS1_VERSION, TLS1_1_VERSION}) {
    const std::string answer = AnswerToHandshake(version);
    EXPECT_TRUE(answer.empty() || answer[0] == 0x15) << version;
  }
  for (const int version : {TLS1_2_VERSION, TLS1_3_VERSION}) {
    const std::string answer = AnswerToHandshake(version);
    ASSERT_FALSE(answer.empty());
    EXPECT_EQ(answer[0], 0x16) << version;
  }
}

TEST_F(Tls, ConnectionsThatEndAreNotCountedAnyMore) {
  for (int i = 0; i < 10; ++i) {
    EXPECT_THAT(ServerClient(UserChannel("viewer")).ListAgents(), IsOk());
    RawSocket socket(port_);
    socket.Send("\x16\x03\x01");
    RawSocket(port_).Send("x");
  }
  const auto open = [&] {
    grpc::ClientContext context;
    v1::GetStatusResponse response;
    EXPECT_TRUE(v1::StatusService::NewStub(channel())->GetStatus(&context, {}, &response).ok());
    return response.connections().open_count();
  };
  EXPECT_TRUE(WaitFor([&] { return open() == 0; })) << open();
}

TEST_F(Tls, OtherAddressesAreServedWithTlsAndThisMachineAlsoWithout) {
  rpc_options_.endpoint.listen_address = "0.0.0.0:0";
  rpc_options_.endpoint.listener.plain_loopback = true;
  RestartServer();
  EXPECT_THAT(ServerClient(UserChannel("viewer")).ListAgents(), IsOk());
  EXPECT_THAT(ServerClient("127.0.0.1:" + std::to_string(port_)).ListAgents(), IsOk());
}

TEST_F(Tls, AClientChecksTheServersName) {
  const TestCertificate elsewhere = ca_.Make({.common_name = "server",
                                              .role = "",
                                              .uris = {"rigcal://server"},
                                              .hosts = {"10.1.2.3", "elsewhere"}});
  ca_.WriteServerFolder(identity(), elsewhere);
  RestartServer();
  EXPECT_THAT(ServerClient(UserChannel("viewer")).ListAgents(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
}

TEST_F(Tls, TheSocketFileServesItsUserWithoutACertificate) {
  rpc_options_.endpoint.socket_file = folder_.path() / "s";
  RestartServer();
  const std::string address = "unix:" + rpc_options_.endpoint.socket_file.string();
  EXPECT_THAT(ServerClient(address).CreateSession(WaveRequest("wave")), IsOk());
  EXPECT_THAT(Audit(), HasSubstr("a client on this machine"));
  CloseServer();
  EXPECT_FALSE(std::filesystem::exists(rpc_options_.endpoint.socket_file));
  OpenServer();
}

}  // namespace
}  // namespace rigcal::testing::tls_test
