#!/bin/sh
# A private CA, the broker's certificate and one for each client, for config/mosquitto-tls.conf.
#   sh config/make-certificates.sh FOLDER BROKER_HOST CLIENT...
# Keep FOLDER/ca.key off the broker: whoever has it can make certificates. The broker's certificate is valid for two
# years. Those of clients end before, two weeks apart: those of a whole plant must not end on one day.
set -eu
umask 077
[ $# -ge 2 ] || { echo "usage: make-certificates.sh FOLDER BROKER_HOST CLIENT..." >&2; exit 2; }
folder=$1 host=$2
shift 2
mkdir -p "$folder"
cd "$folder"

key() { openssl ecparam -name prime256v1 -genkey -noout -out "$1.key"; }

if [ ! -e ca.pem ]; then
    key ca
    openssl req -x509 -new -key ca.key -sha256 -days 3650 -subj "/CN=acqd CA" -out ca.pem \
        -addext "basicConstraints=critical,CA:TRUE" -addext "keyUsage=critical,keyCertSign,cRLSign"
fi

# signed NAME EXTENSIONS DAYS
signed() {
    [ -e "$1.pem" ] && return
    key "$1"
    extensions=$(mktemp)
    printf '%b' "$2" >"$extensions"
    openssl req -new -key "$1.key" -subj "/CN=$1" |
        openssl x509 -req -CA ca.pem -CAkey ca.key -CAcreateserial -sha256 -days "$3" -extfile "$extensions" \
            -out "$1.pem" 2>/dev/null
    rm -f "$extensions"
}

case $host in
*[!0-9.]*) names="DNS:$host" ;;
*) names="IP:$host" ;;
esac
days=730
signed broker "subjectAltName=$names\nextendedKeyUsage=serverAuth\n" $days
for client in "$@"; do
    days=$((days > 379 ? days - 14 : 716))
    signed "$client" "extendedKeyUsage=clientAuth\n" $days
done
