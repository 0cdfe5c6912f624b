# Helpers that keep each folder's CMakeLists.txt short: roadfix_library, roadfix_process, roadfix_test, roadfix_benchmark.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)

# -pthread everywhere, because LCM asks for it and a precompiled header must match.
# -ffp-contract=off and one explicit -march: two builds of one source give the same bits (docs/DESIGN.md, section 5).
add_library(roadfix_options INTERFACE)
target_compile_options(roadfix_options INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -ffp-contract=off -pthread)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  target_compile_options(roadfix_options INTERFACE -march=${ROADFIX_MARCH})
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(roadfix_options INTERFACE -fpch-preprocess)
endif()
if(ROADFIX_STRICT)
  target_compile_options(roadfix_options INTERFACE -Werror)
endif()
if(ROADFIX_SANITIZE)
  target_compile_options(roadfix_options INTERFACE -fsanitize=${ROADFIX_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")  # under sanitizers GCC 12 sees uninitialised values inside std::regex
    target_compile_options(roadfix_options INTERFACE -Wno-maybe-uninitialized)
  endif()
  target_link_options(roadfix_options INTERFACE -fsanitize=${ROADFIX_SANITIZE})
endif()
if(ROADFIX_FUZZ)
  target_compile_options(roadfix_options INTERFACE -fsanitize=fuzzer-no-link)
endif()

# Eigen's headers dominate the compile time of small files: one precompiled header, shared by all who link it.
file(WRITE ${PROJECT_BINARY_DIR}/roadfix_pch.cpp "")
add_library(roadfix_eigen INTERFACE)
target_link_libraries(roadfix_eigen INTERFACE Eigen3::Eigen)
add_library(roadfix_pch OBJECT ${PROJECT_BINARY_DIR}/roadfix_pch.cpp)
target_link_libraries(roadfix_pch PRIVATE roadfix_options roadfix_eigen)
target_precompile_headers(roadfix_pch PRIVATE <Eigen/Dense> <algorithm> <cstdint> <map> <optional> <string> <vector>)

# Below this line of the caller, sources are compiled eight at a time: the headers and templates that they share are most of the work.
# GCC would warn of classes with members of an unnamed namespace, as it should where a header has them; here it takes sources for headers.
macro(roadfix_unity)
  if(ROADFIX_UNITY)
    set(CMAKE_UNITY_BUILD ON)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      add_compile_options(-Wno-subobject-linkage)
    endif()
  endif()
endmacro()

# roadfix_library(NAME SOURCES a.cpp ... DEPS geometry ... SYSTEM_DEPS target ...) makes the target roadfix_NAME, included as "NAME/header.h".
# A library without sources is header-only. DEPS are Roadfix libraries, public.
function(roadfix_library NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;SYSTEM_DEPS" ${ARGN})
  list(TRANSFORM ARG_DEPS PREPEND roadfix_)
  if(ARG_SOURCES)
    add_library(roadfix_${NAME} STATIC ${ARG_SOURCES})
    target_include_directories(roadfix_${NAME} PUBLIC ${PROJECT_SOURCE_DIR}/lib)
    target_link_libraries(roadfix_${NAME} PUBLIC ${ARG_DEPS} roadfix_eigen PRIVATE roadfix_options ${ARG_SYSTEM_DEPS})
    target_precompile_headers(roadfix_${NAME} REUSE_FROM roadfix_pch)
  else()
    add_library(roadfix_${NAME} INTERFACE)
    target_include_directories(roadfix_${NAME} INTERFACE ${PROJECT_SOURCE_DIR}/lib)
    target_link_libraries(roadfix_${NAME} INTERFACE ${ARG_DEPS} roadfix_eigen ${ARG_SYSTEM_DEPS})
  endif()
endfunction()

# roadfix_process(NAME SOURCES handler.cpp ... DEPS ...) makes the library roadfix_process_NAME (the handler, linked by replay and tests)
# and the program bin/NAME from main.cpp.
add_custom_target(roadfix_programs)
function(roadfix_process NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;SYSTEM_DEPS" ${ARGN})
  list(TRANSFORM ARG_DEPS PREPEND roadfix_)
  add_library(roadfix_process_${NAME} STATIC ${ARG_SOURCES})
  target_include_directories(roadfix_process_${NAME} PUBLIC ${PROJECT_SOURCE_DIR}/processes)
  target_link_libraries(roadfix_process_${NAME} PUBLIC ${ARG_DEPS} roadfix_eigen PRIVATE roadfix_options ${ARG_SYSTEM_DEPS})
  target_precompile_headers(roadfix_process_${NAME} REUSE_FROM roadfix_pch)
  add_executable(${NAME} main.cpp)
  target_link_libraries(${NAME} PRIVATE roadfix_process_${NAME} roadfix_build_id roadfix_options)
  target_precompile_headers(${NAME} REUSE_FROM roadfix_pch)
  add_dependencies(roadfix_programs ${NAME})
endfunction()

# roadfix_test(NAME LABELS unit SOURCES a_test.cpp ... DEPS ...) makes bin/NAME_test; each Catch2 test case is one CTest.
# A test case that needs ../shared prints a line "skipped: ..." where it is missing (test/support/shared_data.h); CTest then reports it as skipped.
function(roadfix_test NAME)
  cmake_parse_arguments(ARG "" "TIMEOUT" "LABELS;SOURCES;DEPS;SYSTEM_DEPS" ${ARGN})
  list(TRANSFORM ARG_DEPS PREPEND roadfix_)
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 1800)
  endif()
  add_executable(${NAME}_test ${ARG_SOURCES})
  target_include_directories(${NAME}_test PRIVATE ${PROJECT_SOURCE_DIR}/test ${PROJECT_SOURCE_DIR}/processes)
  target_link_libraries(${NAME}_test PRIVATE ${ARG_DEPS} ${ARG_SYSTEM_DEPS} roadfix_test_support roadfix_options)
  target_precompile_headers(${NAME}_test REUSE_FROM roadfix_test_pch)
  catch_discover_tests(${NAME}_test TEST_PREFIX "${NAME}: " PROPERTIES
    LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT} SKIP_REGULAR_EXPRESSION "skipped: ")
endfunction()

# roadfix_benchmark(NAME SOURCES ... DEPS ...) makes bin/NAME_bench; CTest runs it as a smoke test only, never as a timing.
function(roadfix_benchmark NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;SYSTEM_DEPS" ${ARGN})
  list(TRANSFORM ARG_DEPS PREPEND roadfix_)
  add_executable(${NAME}_bench ${ARG_SOURCES})
  target_include_directories(${NAME}_bench PRIVATE ${PROJECT_SOURCE_DIR}/test)
  target_link_libraries(${NAME}_bench PRIVATE ${ARG_DEPS} ${ARG_SYSTEM_DEPS} benchmark::benchmark benchmark::benchmark_main roadfix_options)
  add_test(NAME "bench: ${NAME}" COMMAND ${NAME}_bench --benchmark_min_time=0.001)
  set_tests_properties("bench: ${NAME}" PROPERTIES LABELS bench)
endfunction()
