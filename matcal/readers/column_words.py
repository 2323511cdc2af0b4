"""The words of columns by quantity and language, written as machines and people have them: data, no code.

A name is one head, around which only qualifiers stand: `Corrected Position`, `Traversenweg absolut`, `deplacement
traverse`. A word that changes what is measured (rate, setpoint, peak, modulus) is neither, so that such a name stays
unknown.
"""

# quantity -> heads; several words between commas are one head
HEADS = {
    "time": """
        time, elapsed, time stamp, timestamp, date time, datetime, time of day, clock, seconds, zeitstempel, uhrzeit,
        heure, zeit, laufzeit, temps, temps ecoule, duree, tiempo, tiempo transcurrido,
        tempo, tijd, czas, čas, cas, doba, zaman, süre, tid, aika, время, час, време, vrijeme, vreme, idő, timp, χρόνος,
        时间, 時間, 時刻, 시간, 경과시간, thời gian""",
    "displacement": """
        displacement, crosshead, cross head, extension, ext, position, pos, disp, displ, travel, stroke,
        distance, separation, grip to grip separation, tool distance, actuator, lvdt, gap,
        x head, weg, wegaufnehmer, verschiebung, traverse, traversenposition, verlängerung,
        längenänderung, längung, hub, position,
        eindringweg,
        déplacement, course, allongement, flèche,
        desplazamiento, recorrido, alargamiento, carrera, posición, extensión, deslocamento, extensão, curso, posição,
        spostamento, corsa, posizione, traversa, cedimento, verplaatsing, slag, positie, verlenging,
        przemieszczenie, droga, położenie, pozycja, skok, ugięcie, posuv, posun, posunutí, dráha, poloha, prodloužení,
        predĺženie, uzama, yer değiştirme, deplasman, konum, strok, förskjutning, väg, rörelse, förlängning, slaglängd,
        forskyvning, forskydning, vandring, siirtymä, liike, asema, matka, перемещение, ход, путь, положение,
        переміщення,
        преместване, pomak, elmozdulás, deplasare, cursă, μετατόπιση, 位移, 行程, 伸长, 伸長, 变形, 變形, 变形量,
        伸长量, 压缩量,
        変位, 変位量, ストローク, 伸び, クロスヘッド, 변위, 스트로크, 이동거리, 신장, 변형, độ dịch chuyển,
        chuyển vị""",
    "force": """
        load, force, load cell, fz, fn, fax, kraft, last, effort, fuerza, carga, força, forza, carico, kracht,
        belasting,
        siła, obciążenie, síla, zatížení, sila, zaťaženie, yük, kuvvet, belastning, voima, kuorma, сила, нагрузка,
        усилие,
        навантаження, натоварване, erő, terhelés, forță, forța, sarcină, δύναμη, φορτίο, 力, 力值, 载荷, 載荷, 负荷,
        負荷, 荷重,
        负载, 荷载, 試験力, 试验力, 하중, 힘, 시험력, lực, tải trọng""",
    "stretch": "stretch, stretch ratio, lambda, λ, streckung, 伸长比, 伸長比",
    "strain": """
        compression ratio, compressive ratio, degree of compression, compression degree, stauchungsgrad,
        taux de compression, grado de compresión, rapporto di compressione,
        strain, microstrain, eyy, exy, exz, eyz, poměrná deformace, angle, winkel, scherwinkel, schubwinkel,
        schiebungswinkel, gleitwinkel, angle de cisaillement,
        eps, epsilon, ε, gamma, γ, dehnung, feindehnung, stauchung, verzerrung, scherung, gleitung, rek,
        deformación, deformazione, deformação, odkształcenie, přetvoření, pomerne predlzenie, poměrné prodloužení,
        gerinim, gerinme, birim uzama, birim şekil değiştirme, şekil değiştirme, töjning, tøyning, tøjning, venymä,
        относительное удлинение, относительная деформация, відносна деформація, deformacija, nyúlás, alakváltozás,
        deformație, παραμόρφωση, 应变, 應變, 伸长率, 压缩率, ひずみ, 歪, 歪み, 歪率, 圧縮率, 변형률, 변형율, 신율,
        신장율, 연신율,
        biến dạng""",
    "stress": """
        stress, sigma, σ, tau, τ, pk1, spannung, contrainte, esfuerzo, sforzo, spanning, naprężenie, napětí,
        napätie,
        gerilme, spänning, spenning, spænding, jännitys, напряжение, напруження, напрежение, naprezanje, feszültség,
        efort unitar, tensiune, τάση, 应力, 應力, 応力, 응력, ứng suất""",
    "current": """
        current, curr, im, measure i, strom, strøm, stromstärke, courant, intensité, corriente, intensidad, corrente,
        stroom, prąd,
        proud, prúd, akım, ström, virta, ток, струм, áram, curent, ρεύμα, 电流, 電流, 전류""",
    "potential": """
        potential, voltage, volt, volts, vout, vf, ewe, bias, potentiel, potencial, potenziale, potenciál,
        voltaje, voltagem,
        elektrische spannung, napięcie, gerilim, voltaj, jännite, потенциал, 电压, 電壓, 電圧, 电位, 전압, điện áp""",
    "resistance": """
        resistance, res, resist, rdc, ohms, widerstand, résistance, resistencia, resistência,
        resistenza, weerstand, opór,
        rezystancja,
        odpor, direnç, resistans, motstand, modstand, resistanssi, сопротивление, опір, съпротивление, ellenállás,
        rezistență, αντίσταση, 电阻, 電阻, 抵抗, 저항, điện trở""",
    "conductivity": """
        conductivity, leitfähigkeit, conductivité, conductividad, condutividade, conduttività, geleidbaarheid,
        przewodność, konduktywność, vodivost, iletkenlik, konduktivitet, johtavuus, проводимость, 电导率, 電導率,
        导电率, 導電率,
        전도도, 전도율""",
    "volume_ratio": "volume ratio, volumetric ratio, jacobian, volumenverhältnis",
    "pressure": """
        pressure, pression, presión, pressão, pressione, druk, ciśnienie, tlak, basınç, tryck, trykk, tryk, paine,
        давление,
        тиск, nyomás, presiune, πίεση, 压强, 圧力, 압력""",
    "cycle": """
        cycle, cycles, cycle count, cycle number, cycle no, cycle index, zyklus, zyklen, zykluszahl, zyklenzahl,
        zyklusnummer, ciclo, ciclos, cicli, cykl, cyklus, cykel, çevrim, döngü, sykli, цикл, цикл номер, 循环,
        循环次数, 循環, 周期,
        サイクル, サイクル数, 사이클""",
    "block": "block, block number, block no",
}

# heads that more than one quantity has: the unit decides, and without one the first, of which a unit is then asked
SHARED_HEADS = {
    "deformation, déformation, деформация, деформація, deformace, deformácia, vervorming, muodonmuutos":
        ("strain", "displacement"),
    "compression, elongation, verformung, alongamento, allungamento, wydłużenie, удлинение, удължение, ściskanie, "
    "odkształcenie trwałe, uzama, allongement, alargamiento, verlängerung, prodloužení, extensão, "
    "变形, 變形, 변형, 伸び, 신장, elongación, kompression, stauchweg, écrasement, "
    "deflection, indentation, eindrückung, enfoncement": ("displacement", "strain"),
    "dmm": ("resistance", "potential", "current"),
    "tension, tensión, tensão, tensione": ("stress", "potential", "force"),
    "spannung, spanning, spänning, spenning, spænding, napětí, napätie, "
    "напряжение, напруження, напрежение, feszültség, "
    "tensiune, τάση, naprezanje": ("stress", "potential"),
    "gerilim": ("potential", "stress"), "压力, 壓力": ("pressure", "force"), "druck": ("pressure", "stress", "force"),
}

# symbols, known only alone or with qualifiers; those in capitals and small letters are one
SYMBOLS = {"t": ("time",), "f": ("force",), "p": ("stress", "force", "pressure"), "e": ("strain", "potential"),
           "u": ("potential", "displacement"), "v": ("potential",), "i": ("current",), "r": ("resistance",),
           "c": ("conductivity",), "j": ("volume_ratio",), "charge": ("force",),
           "vx": ("potential",), "rs": ("resistance",), "rp": ("resistance",), "rx": ("resistance",),
           "p11": ("stress",), "p 11": ("stress",)}

# words around a head that leave it what it is
QUALIFIERS = """
    axial running elapsed corrected corr total test segment step experiment procedure cycle relative rel run
    machine actuator piston ram crosshead digital linear standard std primary applied measured meas actual act absolute
    abs raw net mean filtered tool grip specimen sample compressive compression tensile tension flexure
    flexural bending shear nominal engineering eng normal vertical uniaxial biaxial planar piola volumetric volume axial
    stroke travel displacement extensometer extenso video laser optical dic eyy clip gauge z we smu smua smub source
    sense
    channel ch analog input output dic xx yy zz xy xz yz tensor tensorial wire 4-wire 2-wire 4wire 2wire 4w 2w four
    two point terminal probe
    kelvin pt from preload working electrode value signal
    gleichmass prüf pruf absolut abs gemessen gesamt aktuell nominell nominelle technische axiale f
    axiale nominale totale total réel de la du traverse machine essai mesurée mesuré corrigé verin vérin
    unitaria unitario ingenieril ingeniería nominal axil de del la máquina ensayo ensayo total transcurrido medida
    unitária convencional de máquina teste nominal assiale nominale del della traversa totale macchina prova di
    axiální osová osiowa osiowe nominalne całkowity całkowite trawersy testu kuvveti yükü eksenel toplam
    kokonais осевая осевое нормальное условное относительная время траверсы испытания
    ohmic dc electrical elektrischer elektrische eléctrica électrique elettrica"""

# of these, what stands only in front of a head
LEADING = {"step", "segment", "cycle", "test", "run", "procedure", "experiment"}

# what is glued to a head in front, in languages that write one word
GLUED = """
    standard prüf pruf lauf versuchs test gesamt axial normal druck zug schub scher biege traversen kolben maschinen
    nenn brutto netto mess fein längs zylinder
    proef trek duw test drag tryck tryk trekk total mät prov veto puristus koko
    压缩 壓縮 拉伸 轴向 軸向 横梁 橫樑 试验 試驗 測試 测试 经过 經過 实验 运行 总 剪切 工程 名义 公称 標稱 弯曲 夹头
    活塞 作动器 测量
    圧縮 引張 引張り 試験 軸 曲げ 公称 せん断 ストローク 経過 クロスヘッド
    압축 인장 시험 축 공칭 경과 굽힘"""

# names of one quantity in order of preference, where a file has several
ON_SPECIMEN = r".*(extenso|video|optic|laser|\bdic\b|\bclip|gau?ge|feindehn|ansetz|lvdt|标距).*"
PREFERRED = {"time": (r"time|t|(lauf|pruf|versuchs)zeit|zeit|temps|时间|時間", r"(running|test|elapsed|total) time"),
             "displacement": (r"(?!.*(\babs|separation)).*",), "strain": (ON_SPECIMEN,),
             "potential": (r"(?!.*applied).*",),
             "resistance": (r".*(\b(4|four)[ -]?(w|wire|p|pt|point|probe|terminal)\b|kelvin).*",)}
# quantity -> what the columns are of which the preferred is used although the other differs
SECOND_CHOICE = {"time": "another clock", "displacement": "the absolute position of the frame",
                 "potential": "what was applied, not what was measured"}
# quantity -> what its other columns hold where the first choice was measured on the specimen alone
HOLDS_MORE = {"strain": "what else gives way", "resistance": "leads and contacts"}

# names of what is known and not used by any test -> how it is called; each matched against a whole plain name
SCATTER = r".+ (std|std ?dev|sd|stdabw|standard deviation|standard error|standardabweichung|ecart type)"
UNUSED = (
    ("a standard deviation", SCATTER),
    ("a temperature", r"(.* )?(temperatures?|temp|temperaturen?|temperatur[ae]|lampotila|sicaklik|teplota|hofok)( .*)?"
                      r"|.*(温度|溫度|온도|температура).*"),
    ("a frequency", r"(angular |test )?(frequency|freq|frequenz|kreisfrequenz|frequence|frecuencia|frequencia|frequenza"
                    r"|czestotliwosc|frekvence|frekans|frekvens|taajuus)|omega|ω|.*(频率|頻率|周波数|주파수|частота)"),
)
