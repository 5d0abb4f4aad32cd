// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/tls_probe.h"

#include <fcntl.h>
#include <netdb.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

#include "common/identity/join_string.h"
#include "common/identity/openssl_handles.h"

namespace rigcal {
namespace {

using SslContextPtr = std::unique_ptr<SSL_CTX, openssl::Deleter<SSL_CTX_free>>;
using SslPtr = std::unique_ptr<SSL, openssl::Deleter<SSL_free>>;

constexpr unsigned char kHttp2[] = {2, 'h', '2'};

class Socket {
 public:
  explicit Socket(int fd) : fd_(fd) {}
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int fd() const { return fd_; }

 private:
  const int fd_;
};

// The verification goes on after a fault; the first one is kept in the error of the connection.
int KeepFirstFault(int good, X509_STORE_CTX* context) {
  auto* const ssl =
      static_cast<SSL*>(X509_STORE_CTX_get_ex_data(context, SSL_get_ex_data_X509_STORE_CTX_idx()));
  auto* const first = static_cast<int*>(SSL_get_app_data(ssl));
  if (good == 0 && *first == X509_V_OK) *first = X509_STORE_CTX_get_error(context);
  return 1;
}

TlsFault FaultOfVerdict(int verdict) {
  switch (verdict) {
    case X509_V_OK:
      return TlsFault::kNone;
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
      return TlsFault::kWrongName;
    case X509_V_ERR_CERT_HAS_EXPIRED:
      return TlsFault::kExpired;
    case X509_V_ERR_CERT_NOT_YET_VALID:
      return TlsFault::kNotYetValid;
    default:
      return TlsFault::kOtherCa;
  }
}

std::string LastReason() {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_peek_last_error(), text.data(), text.size());
  return text.data();
}

// A connected socket, or -1 and the fault.
int Connect(const std::string& host, uint16_t port, std::chrono::milliseconds timeout,
            TlsProbe* probe) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &list);
  if (error != 0) {
    *probe = {TlsFault::kUnknownHost, gai_strerror(error)};
    return -1;
  }
  const std::unique_ptr<addrinfo, openssl::Deleter<freeaddrinfo>> owner(list);
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(timeout);
  const timeval limit = {
      .tv_sec = seconds.count(),
      .tv_usec = std::chrono::duration_cast<std::chrono::microseconds>(timeout - seconds).count()};
  for (const addrinfo* entry = list; entry != nullptr; entry = entry->ai_next) {
    const int fd = socket(entry->ai_family, entry->ai_socktype | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    if (connect(fd, entry->ai_addr, entry->ai_addrlen) == 0) return fd;
    const int reason = errno;
    close(fd);
    const bool refused = reason == ECONNREFUSED;
    *probe = {refused ? TlsFault::kPortClosed : TlsFault::kNoAnswer,
              reason == EINPROGRESS || reason == EAGAIN ? "no answer" : strerror(reason)};
  }
  return -1;
}

// False: the identity cannot be used.
bool UseIdentity(const PeerIdentity& identity, SSL_CTX* context) {
  const openssl::CertificatePtr ca = openssl::CertificateFromPem(identity.ca_pem);
  const openssl::CertificatePtr own = openssl::CertificateFromPem(identity.certificate_pem);
  const openssl::KeyPtr key = openssl::PrivateKeyFromPem(identity.key_pem);
  return ca && own && key && X509_STORE_add_cert(SSL_CTX_get_cert_store(context), ca.get()) == 1 &&
         SSL_CTX_use_certificate(context, own.get()) == 1 &&
         SSL_CTX_use_PrivateKey(context, key.get()) == 1;
}

void KeepServerCertificate(SSL* ssl, TlsProbe* probe) {
  const openssl::CertificatePtr shown(SSL_get1_peer_certificate(ssl));
  const openssl::BioPtr out = openssl::WriteBio();
  if (!shown || PEM_write_bio_X509(out.get(), shown.get()) != 1) return;
  auto certificate = ParseCertificate(openssl::TextOf(out));
  if (certificate.ok()) probe->server = *std::move(certificate);
}

// Why the handshake, or the first read after it, failed.
void KeepTlsError(SSL* ssl, int result, TlsProbe* probe) {
  const int kind = SSL_get_error(ssl, result);
  const unsigned long code = ERR_peek_last_error();
  const int reason = ERR_GET_REASON(code);
  probe->detail = kind == SSL_ERROR_SSL ? LastReason() : "the connection was closed";
  // Fatal alerts of the server have numbers of their own (RFC 8446, 6.2), above this one.
  const bool is_alert = kind == SSL_ERROR_SSL && reason >= SSL_AD_REASON_OFFSET;
  if (kind == SSL_ERROR_SSL &&
      (reason == SSL_R_WRONG_VERSION_NUMBER || reason == SSL_R_HTTP_REQUEST)) {
    probe->fault = TlsFault::kPlaintext;
  } else if (is_alert || probe->server.has_value()) {
    probe->fault = TlsFault::kClientRefused;
  } else {
    probe->fault = TlsFault::kBroken;
  }
}

}  // namespace

TlsProbe ProbeTls(const std::string& address, const PeerIdentity* identity,
                  std::chrono::milliseconds timeout) {
  TlsProbe probe;
  std::string host;
  uint16_t port = 0;
  if (!SplitHostPort(address, &host, &port)) return {TlsFault::kUnknownHost, "not HOST:PORT"};
  const Socket socket(Connect(host, port, timeout, &probe));
  if (socket.fd() < 0) return probe;
  ERR_clear_error();
  const SslContextPtr context(SSL_CTX_new(TLS_client_method()));
  if (!context || (identity != nullptr && !UseIdentity(*identity, context.get()))) {
    return {TlsFault::kBroken, "the identity of this PC cannot be used"};
  }
  const SslPtr ssl(SSL_new(context.get()));
  int verdict = X509_V_OK;
  SSL_set_app_data(ssl.get(), &verdict);
  SSL_set_verify(ssl.get(), SSL_VERIFY_PEER, KeepFirstFault);
  X509_VERIFY_PARAM* const rules = SSL_get0_param(ssl.get());
  if (X509_VERIFY_PARAM_set1_ip_asc(rules, host.c_str()) != 1) {
    ERR_clear_error();
    X509_VERIFY_PARAM_set1_host(rules, host.c_str(), host.size());
    SSL_set_tlsext_host_name(ssl.get(), host.c_str());
  }
  SSL_set_alpn_protos(ssl.get(), kHttp2, sizeof kHttp2);
  SSL_set_fd(ssl.get(), socket.fd());
  const int connected = SSL_connect(ssl.get());
  KeepServerCertificate(ssl.get(), &probe);
  if (identity != nullptr && verdict != X509_V_OK) {
    probe.fault = FaultOfVerdict(verdict);
    probe.detail = X509_verify_cert_error_string(verdict);
  } else if (connected != 1) {
    KeepTlsError(ssl.get(), connected, &probe);
  } else {
    // With TLS 1.3 the server judges this PC's certificate after the handshake; an HTTP/2 server
    // that takes it speaks first.
    char byte = 0;
    const int read = SSL_read(ssl.get(), &byte, 1);
    const bool silent = read <= 0 && SSL_get_error(ssl.get(), read) == SSL_ERROR_SYSCALL &&
                        (errno == EAGAIN || errno == EWOULDBLOCK);
    const bool want_read = read <= 0 && SSL_get_error(ssl.get(), read) == SSL_ERROR_WANT_READ;
    if (read <= 0 && !silent && !want_read) KeepTlsError(ssl.get(), read, &probe);
  }
  ERR_clear_error();
  return probe;
}

}  // namespace rigcal
