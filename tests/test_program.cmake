# ols_test_program(name source): a GoogleTest program of one file, whose first comment line `// links: a b` names the libraries
# it needs.
function(ols_test_program name source)
  file(STRINGS ${source} links_line REGEX "^// links: " LIMIT_COUNT 1)
  string(REGEX REPLACE "^// links: *" "" links "${links_line}")
  separate_arguments(links)
  add_executable(${name} ${source})
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR}/host ${CMAKE_SOURCE_DIR}/tools ${CMAKE_SOURCE_DIR}/protocol)
  target_link_libraries(${name} ${links} GTest::gtest GTest::gtest_main)
endfunction()
