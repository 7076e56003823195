set(headers now.hpp)
