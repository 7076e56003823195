set(headers fit_result.hpp)
