# SPDX-License-Identifier: Apache-2.0
# Build options, and the functions that declare libraries and programs.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)

option(RIGCAL_UNITY "Compile the sources of a folder together, which takes a third of the time" ON)
option(RIGCAL_PRECOMPILE "Compile the headers that most sources include once (gcc only)" ON)
option(RIGCAL_FUZZ "Build the fuzz targets as libFuzzer programs; needs clang" OFF)
set(RIGCAL_SANITIZE "" CACHE STRING "Sanitizers to build with, e.g. address,undefined or thread")

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # Checkouts of the same sources share what is compiled. CCACHE_SLOPPINESS: see "Precompiled headers" in ccache's
  # manual.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1
    CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()

# Warnings are never errors here: the flag would split the compiler cache in two. tests/run.sh fails on any warning.
add_library(rigcal_build_flags INTERFACE)
target_compile_options(rigcal_build_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow)
# gcc 12 warns about overlapping copies in std::string that cannot happen (GCC bug 105651).
target_compile_options(rigcal_build_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# Compiled together, a source is an included file, and gcc takes its anonymous namespace for a header's.
if(RIGCAL_UNITY)
  target_compile_options(rigcal_build_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
# gcc collects its garbage from 500 MB on, not from 128 MB: a tenth less time for a fifth more memory.
target_compile_options(rigcal_build_flags INTERFACE
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=500000> $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-expand=200>)
# The same result of a*b+c on every machine: a calibration must not depend on the compiler's use of FMA.
target_compile_options(rigcal_build_flags INTERFACE -ffp-contract=off)
# __FILE__ is relative to the project, so that checkouts in different folders share the compiler cache.
target_compile_options(rigcal_build_flags INTERFACE -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
if(RIGCAL_SANITIZE)
  target_compile_options(rigcal_build_flags INTERFACE -fsanitize=${RIGCAL_SANITIZE}
    -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(rigcal_build_flags INTERFACE -fsanitize=${RIGCAL_SANITIZE})
  # As without the address sanitizer: what Eigen allocates in Ceres it frees here, and the other way round.
  target_compile_definitions(rigcal_build_flags INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
  # With sanitizers, gcc 12 gives false warnings of these kinds; the normal build checks the same files.
  target_compile_options(rigcal_build_flags INTERFACE
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>)
endif()
if(RIGCAL_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "RIGCAL_FUZZ needs clang with its run-time library (Debian: clang libclang-rt-dev); "
      "configure with --preset fuzz")
  endif()
  target_compile_options(rigcal_build_flags INTERFACE -fsanitize=fuzzer-no-link -Wno-unknown-warning-option)
endif()

# Precompiled headers. Sources with compile options of their own (one per instruction set) go without:
# rigcal_compile_apart.
if(RIGCAL_PRECOMPILE AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A precompiled header serves only sources with the same macros, and -pthread defines one.
  target_compile_options(rigcal_build_flags INTERFACE -pthread -fpch-preprocess)
  # Precompiled, the standard library no longer counts as system headers, and gcc 12 shows its false warnings of these
  # kinds there (GCC bug 105651). A build with RIGCAL_PRECOMPILE=OFF checks for them.
  target_compile_options(rigcal_build_flags INTERFACE -Wno-stringop-overflow -Wno-array-bounds)
endif()

# rigcal_precompile(<name> HEADERS ... DEPS ... [OPTIONS ...]): headers that many targets include, compiled once.
function(rigcal_precompile name)
  cmake_parse_arguments(ARG "" "" "HEADERS;DEPS;OPTIONS" ${ARGN})
  if(RIGCAL_PRECOMPILE AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/${name}.cc CONTENT "// Only the headers matter.\n")
    add_library(${name} OBJECT ${PROJECT_BINARY_DIR}/${name}.cc)
    target_link_libraries(${name} PRIVATE ${ARG_DEPS} rigcal_build_flags)
    target_compile_options(${name} PRIVATE ${ARG_OPTIONS})
    target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
  endif()
endfunction()

set(rigcal_common_headers
  <algorithm> <array> <chrono> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory> <mutex> <optional>
  <ranges> <span> <string> <string_view> <utility> <vector> <absl/status/statusor.h> <absl/strings/str_cat.h>)
rigcal_precompile(rigcal_precompiled HEADERS ${rigcal_common_headers} DEPS absl::statusor absl::strings)

# rigcal_compile_together(<target> <precompiled headers>). CMake compiles sources with their own compile options
# separately.
function(rigcal_compile_together target precompiled)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${RIGCAL_UNITY} UNITY_BUILD_BATCH_SIZE 20)
  if(TARGET ${precompiled})
    target_precompile_headers(${target} REUSE_FROM ${precompiled})
  endif()
endfunction()

# rigcal_compile_apart(<source> <options>...): a source with compile options of its own. With sanitizers, kernels take
# minutes to compile at -O3, and are as the rest.
function(rigcal_compile_apart source)
  if(RIGCAL_SANITIZE)
    list(REMOVE_ITEM ARGN -O3)
  endif()
  set_source_files_properties(${source} PROPERTIES COMPILE_OPTIONS "${ARGN}" SKIP_PRECOMPILE_HEADERS ON)
endfunction()

# Called in a folder of numeric code that reads no input: with sanitizers, its small matrices are not watched for use
# after their scope, which takes two fifths of the time.
macro(rigcal_numeric_folder)
  if(RIGCAL_SANITIZE)
    add_compile_options(-fno-sanitize-address-use-after-scope)
  endif()
endmacro()

# How much the compiler optimises. Code that runs for every pixel, event or marker is HOT; code that runs once for each
# command is COLD, which compiles in two thirds of the time; the rest has what the preset says.
function(rigcal_optimise target)
  cmake_parse_arguments(ARG "HOT;COLD" "" "" ${ARGN})
  if(CMAKE_BUILD_TYPE STREQUAL "Debug" OR RIGCAL_SANITIZE)
    return()
  elseif(ARG_HOT)
    target_compile_options(${target} PRIVATE -O3)
  elseif(ARG_COLD)
    target_compile_options(${target} PRIVATE -O1)
    # A precompiled header wants these as they were, and from gcc 13 on -O2 sets them.
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 13
        AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64|i.86")
      target_compile_options(${target} PRIVATE -munroll-only-small-loops -mvzeroupper)
    endif()
  endif()
endfunction()

# rigcal_library(<name> [HOT | COLD] SOURCES ... [DEPS ...]): library rigcal_<name>, alias rigcal::<name>.
function(rigcal_library name)
  cmake_parse_arguments(ARG "HOT;COLD" "" "SOURCES;DEPS" ${ARGN})
  add_library(rigcal_${name} STATIC ${ARG_SOURCES})
  add_library(rigcal::${name} ALIAS rigcal_${name})
  target_include_directories(rigcal_${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(rigcal_${name} PUBLIC ${ARG_DEPS} PRIVATE rigcal_build_flags)
  rigcal_compile_together(rigcal_${name} rigcal_precompiled)
  rigcal_optimise(rigcal_${name} ${ARGN})
endfunction()

# rigcal_header_library(<name> [DEPS ...]): the same for a folder with headers only.
function(rigcal_header_library name)
  cmake_parse_arguments(ARG "" "" "DEPS" ${ARGN})
  add_library(rigcal_${name} INTERFACE)
  add_library(rigcal::${name} ALIAS rigcal_${name})
  target_include_directories(rigcal_${name} INTERFACE ${PROJECT_SOURCE_DIR})
  target_link_libraries(rigcal_${name} INTERFACE ${ARG_DEPS})
endfunction()

# rigcal_program(<file name> SOURCES ... DEPS ...): a program in build/<preset>/bin.
function(rigcal_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPS} rigcal_build_flags)
  rigcal_compile_together(${name} rigcal_precompiled)
  rigcal_optimise(${name} COLD)
endfunction()
