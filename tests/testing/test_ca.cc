// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/test_ca.h"

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <cctype>
#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace rigcal::testing {
namespace {

void Check(bool good, const char* what) {
  if (!good) throw std::runtime_error(std::string("OpenSSL: ") + what);
}

std::string TextOf(BIO* bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  std::string text(data, static_cast<size_t>(size));
  BIO_free(bio);
  return text;
}

std::string PemOf(X509* certificate) {
  BIO* bio = BIO_new(BIO_s_mem());
  PEM_write_bio_X509(bio, certificate);
  return TextOf(bio);
}

std::string PemOf(EVP_PKEY* key) {
  BIO* bio = BIO_new(BIO_s_mem());
  PEM_write_bio_PKCS8PrivateKey(bio, key, nullptr, nullptr, 0, nullptr, nullptr);
  return TextOf(bio);
}

void AddName(X509* certificate, const char* field, const std::string& text) {
  if (text.empty()) return;
  X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate), field, MBSTRING_UTF8,
                             reinterpret_cast<const unsigned char*>(text.data()),
                             static_cast<int>(text.size()), -1, 0);
}

void AddExtension(X509* certificate, X509* issuer, int nid, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str());
  Check(extension != nullptr, value.c_str());
  X509_add_ext(certificate, extension, -1);
  X509_EXTENSION_free(extension);
}

X509* NewCertificate(EVP_PKEY* key, int64_t begins_in_s, int64_t ends_in_s) {
  X509* certificate = X509_new();
  X509_set_version(certificate, 2);
  unsigned char random[8];
  Check(RAND_bytes(random, sizeof(random)) == 1, "random numbers");
  random[0] = static_cast<unsigned char>((random[0] & 0x7f) | 0x40);
  BIGNUM* number = BN_bin2bn(random, sizeof(random), nullptr);
  BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate));
  BN_free(number);
  X509_gmtime_adj(X509_getm_notBefore(certificate), static_cast<long>(begins_in_s));
  X509_gmtime_adj(X509_getm_notAfter(certificate), static_cast<long>(ends_in_s));
  X509_set_pubkey(certificate, key);
  return certificate;
}

bool IsAddress(const std::string& host) {
  unsigned char bytes[16];
  return inet_pton(AF_INET, host.c_str(), bytes) == 1 ||
         inet_pton(AF_INET6, host.c_str(), bytes) == 1;
}

}  // namespace

struct TestCa::Keys {
  EVP_PKEY* key = nullptr;
  X509* certificate = nullptr;
};

TestCa::TestCa() : keys_(std::make_unique<Keys>()) {
  keys_->key = EVP_EC_gen("P-256");
  Check(keys_->key != nullptr, "key");
  keys_->certificate = NewCertificate(keys_->key, -7200, 3650L * 86'400);
  X509* const certificate = keys_->certificate;
  AddName(certificate, "CN", "rigcal test CA");
  X509_set_issuer_name(certificate, X509_get_subject_name(certificate));
  AddExtension(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE");
  AddExtension(certificate, certificate, NID_key_usage, "critical,keyCertSign,cRLSign");
  AddExtension(certificate, certificate, NID_subject_key_identifier, "hash");
  Check(X509_sign(certificate, keys_->key, EVP_sha256()) > 0, "signature");
  certificate_pem_ = PemOf(certificate);
}

TestCa::~TestCa() {
  EVP_PKEY_free(keys_->key);
  X509_free(keys_->certificate);
}

TestCertificate TestCa::Make(const CertificateWish& wish) const {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  X509* certificate = NewCertificate(key, wish.begins_in_s, wish.ends_in_s);
  AddName(certificate, "CN", wish.common_name);
  AddName(certificate, "OU", wish.role);
  X509* const issuer = wish.self_signed ? certificate : keys_->certificate;
  X509_set_issuer_name(certificate, X509_get_subject_name(issuer));
  AddExtension(certificate, issuer, NID_basic_constraints, "critical,CA:FALSE");
  AddExtension(certificate, issuer, NID_ext_key_usage,
               wish.hosts.empty() ? "clientAuth" : "serverAuth");
  std::string names;
  for (const std::string& uri : wish.uris) names += ",URI:" + uri;
  for (const std::string& host : wish.hosts) names += (IsAddress(host) ? ",IP:" : ",DNS:") + host;
  if (!names.empty()) {
    AddExtension(certificate, issuer, NID_subject_alt_name, names.substr(1));
  }
  Check(X509_sign(certificate, wish.self_signed ? key : keys_->key, EVP_sha256()) > 0, "signature");
  TestCertificate result{
      .certificate_pem = PemOf(certificate), .key_pem = PemOf(key), .serial = ""};
  BIGNUM* number = ASN1_INTEGER_to_BN(X509_get_serialNumber(certificate), nullptr);
  char* text = BN_bn2hex(number);
  for (const char* digit = text; *digit != '\0'; ++digit) {
    result.serial += static_cast<char>(std::tolower(static_cast<unsigned char>(*digit)));
  }
  OPENSSL_free(text);
  BN_free(number);
  X509_free(certificate);
  EVP_PKEY_free(key);
  return result;
}

TestCertificate TestCa::MakeAgent(const std::string& agent_id) const {
  return Make({.common_name = agent_id, .uris = {"rigcal://agents/" + agent_id}});
}

TestCertificate TestCa::MakeUser(const std::string& name, const std::string& role) const {
  return Make({.common_name = name, .role = role, .uris = {"rigcal://users/" + name}});
}

TestCertificate TestCa::MakeServer() const {
  return Make({.common_name = "server",
               .role = "",
               .uris = {"rigcal://server"},
               .hosts = {"127.0.0.1", "127.0.0.2", "::1", "localhost"}});
}

void TestCa::WriteServerFolder(const std::filesystem::path& folder,
                               const TestCertificate& certificate) const {
  std::filesystem::create_directories(folder);
  ReplaceTestFile(folder / "ca.crt", certificate_pem_);
  ReplaceTestFile(folder / "server.crt", certificate.certificate_pem);
  ReplaceTestFile(folder / "server.key", certificate.key_pem);
}

void TestCa::WriteCaKey(const std::filesystem::path& folder) const {
  ReplaceTestFile(folder / "ca.key", PemOf(keys_->key));
}

void ReplaceTestFile(const std::filesystem::path& path, const std::string& text) {
  const std::filesystem::path temporary = path.string() + ".test";
  {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    file << text;
  }
  Check(std::rename(temporary.c_str(), path.c_str()) == 0, "rename");
}

}  // namespace rigcal::testing
