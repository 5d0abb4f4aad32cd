// SPDX-License-Identifier: Apache-2.0
#include "server/identity/server_identity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <string>
#include <vector>

#include "common/file/durable_file.h"
#include "common/identity/certificate.h"
#include "common/identity/private_key.h"
#include "server/identity/certificate_authority.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::server_identity_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;

class ServerIdentity : public ::testing::Test {
 protected:
  absl::Status Ensure(const std::vector<std::string>& hosts = {"10.0.0.5", "fd00::5", "rig.lab"},
                      absl::Duration later = absl::ZeroDuration()) {
    return server::EnsureServerIdentity(data_.path(), hosts, start_ + later);
  }
  std::filesystem::path File(const char* name) const {
    return server::IdentityDirectory(data_.path()) / name;
  }
  std::string Read(const char* name) const { return *ReadSmallFile(File(name)); }
  Certificate ServerCertificate() const { return *ParseCertificate(Read("server.crt")); }
  void Write(const char* name, const std::string& text) const {
    std::ofstream(File(name), std::ios::trunc) << text;
  }

  const absl::Time start_ = absl::FromUnixSeconds(absl::ToUnixSeconds(absl::Now()));
  TemporaryDirectory data_;
};

TEST_F(ServerIdentity, IsMadeAtTheFirstStart) {
  ASSERT_THAT(Ensure(), IsOk());
  const Certificate certificate = ServerCertificate();
  EXPECT_THAT(CheckIssuedBy(certificate, Read("ca.crt"), CertificateUse::kServer), IsOk());
  EXPECT_THAT(CheckIssuedBy(certificate, Read("ca.crt"), CertificateUse::kClient), Not(IsOk()));
  EXPECT_THAT(CheckKeyOf(certificate.pem, Read("server.key"), "server"), IsOk());
  EXPECT_EQ(certificate.uri, "rigcal://server");
  EXPECT_THAT(certificate.hosts, IsSupersetOf({"10.0.0.5", "fd00::5", "rig.lab", "localhost"}));
  // A clock that is a year off, on either side, still takes it.
  EXPECT_LT(certificate.not_before, start_ - absl::Hours(24 * 366));
  EXPECT_GT(certificate.not_after - server::kServerRenewalAge, start_ + absl::Hours(24 * 366));
  for (const char* name : {"ca.crt", "ca.key", "server.crt", "server.key"}) {
    struct stat status {};
    ASSERT_EQ(stat(File(name).c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0600u) << name;
  }
  struct stat status {};
  ASSERT_EQ(stat(File("").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0700u);
}

TEST_F(ServerIdentity, StaysAsLongAsItIsGood) {
  ASSERT_THAT(Ensure(), IsOk());
  const std::string ca = Read("ca.crt");
  const std::string certificate = Read("server.crt");
  ASSERT_THAT(Ensure({"rig.lab", "FD00::5", "10.0.0.5"}, absl::Hours(24 * 10)), IsOk());
  EXPECT_EQ(Read("server.crt"), certificate) << "the order and the spelling do not matter";
  EXPECT_EQ(Read("ca.crt"), ca);
}

TEST_F(ServerIdentity, FollowsTheAddressesOfThePc) {
  ASSERT_THAT(Ensure(), IsOk());
  const std::string key = Read("server.key");
  ASSERT_THAT(Ensure({"10.0.0.99"}), IsOk());
  EXPECT_THAT(ServerCertificate().hosts, ::testing::Contains("10.0.0.99"));
  EXPECT_THAT(ServerCertificate().hosts, Not(::testing::Contains("10.0.0.5")));
  EXPECT_EQ(Read("server.key"), key) << "so that one rename replaces the whole identity";
}

TEST_F(ServerIdentity, IsRenewedWithAge) {
  ASSERT_THAT(Ensure(), IsOk());
  const std::string certificate = Read("server.crt");
  ASSERT_THAT(Ensure({"10.0.0.5", "fd00::5", "rig.lab"}, server::kServerRenewalAge), IsOk());
  EXPECT_NE(Read("server.crt"), certificate);
  // A clock that was ahead when the certificate was made.
  ASSERT_THAT(Ensure({"10.0.0.5", "fd00::5", "rig.lab"}, -absl::Hours(24 * 365)), IsOk());
  EXPECT_GT(ServerCertificate().not_after, start_);
}

TEST_F(ServerIdentity, RepairsItsOwnFilesButNeverTheCa) {
  ASSERT_THAT(Ensure(), IsOk());
  const std::string ca = Read("ca.crt");
  for (const char* name : {"server.crt", "server.key"}) {
    Write(name, "damaged");
    ASSERT_THAT(Ensure(), IsOk()) << name;
    EXPECT_THAT(CheckKeyOf(Read("server.crt"), Read("server.key"), "server"), IsOk()) << name;
    std::filesystem::remove(File(name));
    ASSERT_THAT(Ensure(), IsOk()) << name;
  }
  Write("server.key", *MakePrivateKey());
  ASSERT_THAT(Ensure(), IsOk());
  EXPECT_THAT(CheckKeyOf(Read("server.crt"), Read("server.key"), "server"), IsOk());
  EXPECT_EQ(Read("ca.crt"), ca);
  const std::string ca_key = Read("ca.key");
  for (const auto& [name, text] : {std::pair{"ca.key", std::string("damaged")},
                                   {"ca.key", *MakePrivateKey()},
                                   {"ca.crt", std::string("damaged")}}) {
    Write("ca.crt", ca);
    Write("ca.key", ca_key);
    Write(name, text);
    EXPECT_THAT(Ensure(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("backup")));
    EXPECT_EQ(Read(name), text) << "it is left as it is";
  }
  Write("ca.crt", ca);
  // Certificates that are made elsewhere, or a key that got lost.
  std::filesystem::remove(File("ca.key"));
  EXPECT_THAT(Ensure({"10.0.0.99"}), IsOk());
  EXPECT_TRUE(server::HasForeignCa(File("")));
  std::filesystem::remove(File("server.crt"));
  EXPECT_THAT(Ensure(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("ca.key")));
}

TEST_F(ServerIdentity, FinishesAFirstStartThatWasKilled) {
  ASSERT_THAT(Ensure(), IsOk());
  const std::string key = Read("ca.key");
  std::filesystem::remove(File("ca.crt"));
  Write("server.key.new", "half of a file");
  ASSERT_THAT(Ensure(), IsOk());
  EXPECT_EQ(Read("ca.key"), key);
  EXPECT_THAT(CheckIssuedBy(ServerCertificate(), Read("ca.crt"), CertificateUse::kServer), IsOk());
}

TEST_F(ServerIdentity, RefusesHostsThatAreNone) {
  for (const char* host : {"", "a,IP:6.6.6.6", "a b", "a\nb"}) {
    EXPECT_THAT(Ensure({host}), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("address")));
  }
}

TEST(ReachableHosts, AreThoseOfTheInterfacesForAllAddresses) {
  EXPECT_EQ(server::ReachableHosts("10.0.0.5"), std::vector<std::string>{"10.0.0.5"});
  EXPECT_EQ(server::ReachableHosts("[fd00::5]"), std::vector<std::string>{"fd00::5"});
  for (const std::string& host : server::ReachableHosts("0.0.0.0")) {
    EXPECT_FALSE(server::IsLoopbackHost(host)) << host;
    EXPECT_THAT(host, Not(IsEmpty()));
  }
  EXPECT_TRUE(server::IsLoopbackHost("127.0.0.2"));
  EXPECT_FALSE(server::IsLoopbackHost("127.example.org"));
}

}  // namespace
}  // namespace rigcal::testing::server_identity_test
